#include "stages/input/tracker_input.h"

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "core/format.h"
#include "core/some_of.h"
#include "dataset/trackers/tracker_file.h"

namespace mvstudio::stages {
namespace {

using dataset::TrackedPoints;

const dataset::TrackerFormat* FormatOf(const std::string& path) {
  std::error_code error;
  return std::filesystem::is_regular_file(path, error) ? dataset::FindTrackerFormat(path) : nullptr;
}

void WarnOfDifferences(const TrackedPoints& camera, const std::vector<std::string>& joints, InputNotes* notes) {
  std::vector<std::string> lacking;
  for (const std::string& joint : joints) {
    if (std::find(camera.joints.begin(), camera.joints.end(), joint) == camera.joints.end()) lacking.push_back(joint);
  }
  if (!lacking.empty()) {
    notes->warnings.push_back({"POSE-JOINTS-DIFFER",
                               camera.track.camera + ": its file lacks " + std::to_string(lacking.size()) + " of " +
                                   std::to_string(joints.size()) + " joints that other cameras have: " + SomeOf(lacking),
                               "the others still give these joints; track all cameras with one network if they should too"});
  }
  if (camera.individuals.size() > 1) {
    notes->warnings.push_back({"POSE-INDIVIDUALS",
                               camera.track.camera + ": " + std::to_string(camera.individuals.size()) + " individuals (" +
                                   SomeOf(camera.individuals) +
                                   "); they are matched across cameras by their places, and numbered, without their names",
                               "option 'max-persons' says how many are kept"});
  }
}

void NoteTimes(const std::string& told, InputNotes* notes) {
  notes->warnings.push_back(
      {"POSE-TIMES", "rows were numbered by their times, from time 0, since no column gives frames: " + told,
       "where cameras run at different rates, or their clocks begin apart, see options 'rate' and 'sync'"});
}

/// Frames that were found by times; cameras of other steps have other frames.
void NoteTimesFound(const std::vector<TrackedPoints>& cameras, InputNotes* notes) {
  std::string told;
  for (const TrackedPoints& camera : cameras) {
    if (camera.time_step > 0)
      told += (told.empty() ? "" : ", ") + camera.track.camera + Format(" (a frame every %.6g)", camera.time_step);
  }
  if (!told.empty()) NoteTimes(told, notes);
}

/// Adds the bones whose joints exist, each once.
void AddBones(const NamedBones& bones, geometry::Skeleton* skeleton) {
  for (const auto& [from, to] : bones) {
    const int a = skeleton->Find(from), b = skeleton->Find(to);
    const auto same = [a = a, b = b](const std::pair<int, int>& bone) {
      return bone == std::pair(a, b) || bone == std::pair(b, a);
    };
    if (a < 0 || b < 0 || a == b || std::any_of(skeleton->bones.begin(), skeleton->bones.end(), same)) continue;
    skeleton->bones.emplace_back(a, b);
  }
}

/// Joints with the bones that files state between them, else those of their project.
geometry::Skeleton JoinedSkeleton(const std::vector<TrackedPoints>& cameras, const std::vector<std::string>& joints,
                                  const NamedBones& of_project) {
  geometry::Skeleton skeleton = geometry::PointsSkeleton(joints);
  for (const TrackedPoints& camera : cameras) AddBones(camera.bones, &skeleton);
  if (skeleton.bones.empty()) AddBones(of_project, &skeleton);
  return skeleton;
}

/// Arrays without names have the joints of the skeleton, where that has as many.
void NameAsSkeleton(const geometry::Skeleton& skeleton, std::vector<TrackedPoints>* cameras) {
  for (TrackedPoints& camera : *cameras) {
    const bool unnamed = camera.program == "NumPy" && !camera.joints.empty() && camera.joints[0] == "point_0";
    if (unnamed && camera.joints.size() == skeleton.joints.size()) camera.joints = skeleton.joints;
  }
}

dataset::Pose2dSet ReadArraysOfAll(const std::string& path, const std::optional<geometry::Skeleton>& given, InputNotes* notes) {
  std::vector<TrackedPoints> cameras = dataset::ReadPointArrays(path);
  if (given) NameAsSkeleton(*given, &cameras);
  for (const TrackedPoints& camera : cameras) WarnOfDifferences(camera, camera.joints, notes);
  dataset::Pose2dSet set;
  set.skeleton = given ? *given : geometry::PointsSkeleton(dataset::UnitedJoints(cameras));
  set.tracks = dataset::ToSkeleton(std::move(cameras), set.skeleton);
  return set;
}

}  // namespace

bool HasTrackerFile(const std::vector<NamedPath>& pose2d) {
  return std::any_of(pose2d.begin(), pose2d.end(), [](const NamedPath& named) { return FormatOf(named.path) != nullptr; });
}

dataset::Pose2dSet ReadTrackerFiles(const std::vector<NamedPath>& pose2d, const std::optional<geometry::Skeleton>& given,
                                    const NamedBones& of_project, InputNotes* notes) {
  std::vector<TrackedPoints> cameras;
  for (const auto& [camera, path] : pose2d) {
    std::error_code error;
    if (!std::filesystem::exists(path, error)) throw IoError(path, "no such file or folder");
    if (!FormatOf(path)) {
      throw UsageError("option 'pose2d' " + camera + "=" + path +
                       " is no file of DeepLabCut or SLEAP, nor an array, but another camera's is; give files of one program "
                       "for all cameras");
    }
    cameras.push_back(dataset::ReadTrackerFile(path, camera));
  }
  if (given) NameAsSkeleton(*given, &cameras);
  const std::vector<std::string> joints = dataset::UnitedJoints(cameras);
  for (const TrackedPoints& camera : cameras) WarnOfDifferences(camera, joints, notes);
  NoteTimesFound(cameras, notes);
  dataset::Pose2dSet set;
  set.skeleton = given ? *given : JoinedSkeleton(cameras, joints, of_project);
  set.tracks = dataset::ToSkeleton(std::move(cameras), set.skeleton);
  return set;
}

dataset::Pose2dSet ReadPointsTable(const std::string& path, const std::optional<geometry::Skeleton>& given, InputNotes* notes) {
  const geometry::Skeleton* named = given ? &*given : nullptr;
  const dataset::TrackerFormat* format = FormatOf(path);
  if (!format) {
    dataset::Pose2dSet set = dataset::ReadPose2dCsv(path, named);
    if (set.time_step > 0) NoteTimes(Format("all cameras (a frame every %.6g)", set.time_step), notes);
    return set;
  }
  if (format->name == "NumPy array") return ReadArraysOfAll(path, given, notes);
  if (format->read) {
    throw FormatError(path, "",
                      "one camera's " + std::string(format->name) +
                          ", not a table of all cameras; give it as option "
                          "'pose2d' NAME=FILE, once for each camera");
  }
  dataset::CaliscopePoints points = dataset::ReadCaliscopeCsv(path, named);
  if (points.num_beyond > 0) {
    notes->warnings.push_back({"POSE-POINTS-BEYOND",
                               std::to_string(points.num_beyond) + " rows are of points that skeleton " + given->name +
                                   " does not have, and are left out",
                               "leave option 'skeleton' out to keep every point under its number"});
  }
  return std::move(points.set);
}

}  // namespace mvstudio::stages
