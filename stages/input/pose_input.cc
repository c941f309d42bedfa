#include "stages/input/pose_input.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <set>

#include "core/error.h"
#include "core/some_of.h"
#include "geometry/rig/lenses_only.h"
#include "geometry/skeleton/skeleton_text.h"
#include "stages/input/calib_read.h"
#include "stages/input/first_frames.h"
#include "stages/input/pose_source.h"
#include "stages/input/score_input.h"
#include "stages/input/take_frames.h"

namespace mvstudio::stages {
namespace {

PoseInput ReadRig(const PoseArguments& arguments, InputNotes* notes) {
  if (arguments.pose2d.empty() == arguments.points2d.empty())
    throw UsageError("give either option 'pose2d' or option 'points2d'");
  PoseInput input;
  notes->inputs.push_back(arguments.calib);
  CalibReadOptions read;
  if (!arguments.calib_unit.empty()) FromString(arguments.calib_unit, "unit", &read.unit);
  read.invert = arguments.invert, read.mirror = arguments.mirror;
  const calib::ImportedRig imported = ReadCalibrationFiles({arguments.calib}, read);
  AddNotes(imported.notes, notes);
  input.rig = imported.rig;
  if (!arguments.lenses_suffice) RequirePoses(input.rig, arguments.calib);
  return input;
}

using Folders = std::map<std::string, dataset::OpenPoseFolder>;  // by camera

/// Takes the detections of joints out, as if nobody had seen them.
void LeaveOutJoints(const std::vector<std::string>& names, PoseInput* input) {
  for (const std::string& name : names) {
    const int joint = geometry::FindJoint(input->skeleton, name);
    if (joint < 0) throw UsageError("option 'without-joint': " + geometry::UnknownJoint(input->skeleton, name));
    for (dataset::Pose2dTrack& track : input->tracks) {
      for (auto& [frame, people] : track.frames) {
        for (dataset::Person2d& person : people) person.keypoints.at(static_cast<size_t>(joint)).score = 0;
      }
    }
  }
}

/// Files spread over the take.
std::vector<dataset::Pose2dTrack> SomeOfFolders(const PoseArguments& arguments, const Folders& folders,
                                                const geometry::Skeleton& skeleton) {
  constexpr size_t kFiles = 200;
  std::vector<dataset::Pose2dTrack> some;
  for (const auto& [camera, path] : arguments.pose2d) {
    const dataset::OpenPoseFolder& folder = folders.at(camera);
    const size_t every = std::max<size_t>(1, folder.num_files() / kFiles);
    some.push_back(folder.Read(skeleton, {0, std::numeric_limits<int>::max(), true, every}));
  }
  return some;
}

/// A part of every camera's folder, in the part's skeleton.
void ReadPart(const PoseArguments& arguments, const Folders& folders, const dataset::FrameRange& range, InputNotes* notes,
              PoseInput* part) {
  for (const auto& [camera, path] : arguments.pose2d) {
    part->tracks.push_back(folders.at(camera).Read(part->skeleton, range));
    notes->inputs.push_back(path);
    ListSkipped(part->tracks.back().skipped, notes);
  }
}

/// Joints of a skeleton that was asked for and that no file gives.
void WarnOfMissing(const PoseInput& input, InputNotes* notes) {
  std::vector<char> seen(input.skeleton.joints.size(), 0);
  for (const dataset::Pose2dTrack& track : input.tracks) {
    for (const auto& [frame, people] : track.frames) {
      for (const dataset::Person2d& person : people) {
        for (size_t j = 0; j < person.keypoints.size(); ++j) seen[j] |= person.keypoints[j].score > 0;
      }
    }
  }
  std::vector<std::string> missing;
  for (size_t j = 0; j < seen.size(); ++j) {
    if (!seen[j]) missing.push_back(input.skeleton.joints[j]);
  }
  if (missing.empty()) return;
  notes->warnings.push_back({"POSE-JOINTS-MISSING",
                             "the files have none of these joints of skeleton " + input.skeleton.name + ": " + SomeOf(missing),
                             "joints are found by their names: the skeleton's must be those of the files"});
}

/// Frames that some cameras lack have fewer partners; cut videos would look the same.
void WarnOfFrames(const PoseInput& input, InputNotes* notes) {
  constexpr double kFew = 0.9;
  constexpr size_t kLeastFrames = 10;
  std::set<int> all;
  for (const dataset::Pose2dTrack& track : input.tracks) {
    for (const auto& [frame, people] : track.frames) all.insert(frame);
  }
  if (all.size() < kLeastFrames) return;
  std::string lacking;
  for (const dataset::Pose2dTrack& track : input.tracks) {
    if (track.frames.empty() || static_cast<double>(track.frames.size()) >= kFew * static_cast<double>(all.size())) continue;
    lacking += (lacking.empty() ? "" : ", ") + track.camera + " has " + std::to_string(track.frames.size()) + " (" +
               std::to_string(track.frames.begin()->first) + " to " + std::to_string(track.frames.rbegin()->first) + ")";
  }
  if (lacking.empty()) return;
  notes->warnings.push_back({"POSE-FRAMES-DIFFER",
                             "of " + std::to_string(all.size()) + " frames (" + std::to_string(*all.begin()) + " to " +
                                 std::to_string(*all.rbegin()) + ") " + lacking + ": the others have no partner there",
                             "if its video begins or ends elsewhere, frames with equal numbers may be other moments: "
                             "mvstudio sync finds offsets"});
}

/// The same camera under two names: triangulation counts its pixels once.
void WarnOfDuplicates(const geometry::Rig& rig, const std::vector<std::string>& cameras, InputNotes* notes) {
  if (geometry::HasLensesOnly(rig)) return;
  const std::vector<int> duplicate_of = triangulate::Prepare(rig).duplicate_of;
  for (const std::string& name : cameras) {
    const int camera = rig.Find(name);
    if (camera < 0 || duplicate_of[static_cast<size_t>(camera)] < 0) continue;
    const std::string& original = rig.cameras[static_cast<size_t>(duplicate_of[static_cast<size_t>(camera)])].camera.name;
    notes->warnings.push_back(
        {"TRI-DUPLICATE", name + " has the lens and the place of " + original + ": it counts once where their pixels agree",
         "leave one of the two out"});
  }
}

/// Frames between those that were asked for are not of the take.
void LimitToNumbers(const std::vector<int>& numbers, PoseInput* part) {
  for (dataset::Pose2dTrack& track : part->tracks) {
    for (auto it = track.frames.begin(); it != track.frames.end();)
      it = std::binary_search(numbers.begin(), numbers.end(), it->first) ? std::next(it) : track.frames.erase(it);
  }
}

/// The tracks as everything later takes them.
void Change(const PoseArguments& arguments, const geometry::Rig& rig, PoseInput* input) {
  ApplyChanges(arguments.changes, rig, input->skeleton, &input->tracks);
  RefuseEqual(input->tracks, rig, arguments.pose2d, arguments.points2d);
  LeaveOutJoints(arguments.without_joints, input);
}

void CheckCameras(const PoseInput& input, InputNotes* notes) {
  if (input.cameras.size() < 2) throw UsageError("at least two cameras are needed, option 'pose2d' NAME=FOLDER once for each");
  WarnOfDuplicates(input.rig, input.cameras, notes);
}

/// Frames by the take's own numbers, scores from 0 to 1, pixels of the calibrated images.
void MakeTake(const PoseArguments& arguments, const PoseReading& source, InputNotes* notes, PoseInput* input) {
  LimitFrames(arguments.changes, &input->tracks, notes);
  if (!source.whole_table) WarnOfFrames(*input, notes);
  if (arguments.changes.frames.empty() || !arguments.changes.first_frame.empty())
    NumberFromZero(arguments.changes, arguments.footage, &input->tracks, notes, {&input->rig, &input->skeleton});
  if (source.joints_by_name && !arguments.skeleton.empty()) WarnOfMissing(*input, notes);
  ScoresToShares(arguments.changes, source.whole_table, &input->tracks, notes);
  Change(arguments, input->rig, input);
}

/// All but the frames.
PoseInput ReadWholeTracks(const PoseArguments& arguments, InputNotes* notes) {
  PoseInput input = ReadRig(arguments, notes);
  PoseReading source = ReadPoseSource(arguments, notes);
  input.skeleton = std::move(source.skeleton), input.tracks = std::move(source.tracks);
  MakeTake(arguments, source, notes, &input);
  for (const dataset::Pose2dTrack& track : input.tracks) input.cameras.push_back(track.camera);
  CheckCameras(input, notes);
  input.limbs = LimbsOf(input.skeleton);
  return input;
}

}  // namespace

std::vector<std::pair<int, int>> LimbsOf(const geometry::Skeleton& skeleton) {
  if (!skeleton.human && !skeleton.bones.empty()) return skeleton.bones;
  std::vector<std::pair<int, int>> limbs;
  for (const std::string side : {"L", "R"}) {
    for (const auto& [from, to] : {std::pair("Shoulder", "Elbow"), {"Elbow", "Wrist"}, {"Hip", "Knee"}, {"Knee", "Ankle"}}) {
      const int a = skeleton.Find(side + from), b = skeleton.Find(side + to);
      if (a >= 0 && b >= 0) limbs.emplace_back(a, b);
    }
  }
  return limbs;
}

triangulate::TakeBody BodyOf(const geometry::Skeleton& skeleton) {
  triangulate::TakeBody body{static_cast<int>(skeleton.joints.size()), geometry::MirrorGroups(skeleton)};
  if (skeleton.human) {
    body.sides = {skeleton.Find("Nose"), skeleton.Find("LShoulder"), skeleton.Find("RShoulder"), skeleton.Find("LHip"),
                  skeleton.Find("RHip")};
  }
  return body;
}

PoseInput ReadPoseInput(const PoseArguments& arguments, InputNotes* notes) {
  PoseInput input = ReadWholeTracks(arguments, notes);
  input.frames = ToFrames(input.tracks, input.rig, arguments.calib);
  return input;
}

PoseParts::PoseParts(const PoseArguments& arguments, InputNotes* notes) : arguments_(arguments) {
  std::set<int> numbers;
  const auto is_folder = [](const NamedPath& named) { return std::filesystem::is_directory(named.path); };
  if (arguments.points2d.empty() && std::all_of(arguments.pose2d.begin(), arguments.pose2d.end(), is_folder)) {
    CheckNamedOnce(arguments.pose2d);
    input_ = ReadRig(arguments, notes);
    input_.skeleton = SkeletonOfFrames(arguments, notes);
    input_.limbs = LimbsOf(input_.skeleton);
    if (!arguments.changes.rate.empty())
      throw UsageError("option 'rate' needs the whole take: leave option 'chunk-frames' out");
    if (!arguments.changes.first_frame.empty())
      throw UsageError("option 'first-frame' needs the whole take: leave option 'chunk-frames' out");
    const auto& without = arguments.changes.without_cameras;
    for (const auto& [camera, folder] : arguments.pose2d) {
      if (std::find(without.begin(), without.end(), camera) == without.end()) input_.cameras.push_back(camera);
      const std::vector<int> frames = folders_.emplace(camera, dataset::OpenPoseFolder(folder, camera)).first->second.Frames();
      numbers.insert(frames.begin(), frames.end());
    }
    const std::vector<int> kept = LimitFrames(arguments.changes, std::vector<int>(numbers.begin(), numbers.end()), notes);
    numbers = std::set<int>(kept.begin(), kept.end());
    CheckCameras(input_, notes);
    const std::vector<dataset::Pose2dTrack> some = SomeOfFolders(arguments, folders_, input_.skeleton);
    if (!arguments.changes.ignore_scores) scales_ = ScoreScalesOf(some, false, notes);
    for (const dataset::Pose2dTrack& track : some) arguments_.changes.shares[track.camera] = SharesOf(track);
  } else {
    input_ = ReadWholeTracks(arguments, notes);
    tracks_.swap(input_.tracks);
    for (const dataset::Pose2dTrack& track : tracks_) {
      for (const auto& [frame, people] : track.frames) numbers.insert(frame);
    }
  }
  numbers_.assign(numbers.begin(), numbers.end());
}

std::vector<triangulate::DetectedFrame> PoseParts::Read(size_t begin, size_t end, InputNotes* notes) const {
  end = std::min(end, numbers_.size());
  if (begin >= end) return {};
  const dataset::FrameRange range{numbers_[begin], numbers_[end - 1], true};
  if (!tracks_.empty()) return ToFrames(tracks_, input_.rig, arguments_.calib, range);
  PoseInput part;
  part.skeleton = input_.skeleton;
  InputNotes own;
  ReadPart(arguments_, folders_, range, &own, &part);
  LimitToNumbers(numbers_, &part);
  for (dataset::Pose2dTrack& track : part.tracks) {
    if (const auto scale = scales_.find(track.camera); scale != scales_.end()) dataset::ScoresToShares(scale->second, &track);
  }
  Change(arguments_, input_.rig, &part);
  for (const dataset::Pose2dTrack& track : part.tracks) {
    std::set<std::string>& damaged = damaged_[track.camera];
    damaged.insert(track.skipped.begin(), track.skipped.end());
    if (2 * damaged.size() > folders_.at(track.camera).num_files())
      throw FormatError("camera " + track.camera, "",
                        "more than half of its files cannot be read; the first: " + *damaged.begin());
  }
  notes->partial = notes->partial || own.partial;
  notes->warnings.insert(notes->warnings.end(), own.warnings.begin(), own.warnings.end());
  return ToFrames(part.tracks, input_.rig, arguments_.calib);
}

}  // namespace mvstudio::stages
