#include "stages/input/pose_source.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>

#include "core/error.h"
#include "geometry/skeleton/skeleton_text.h"
#include "stages/input/tracker_input.h"

namespace mvstudio::stages {
namespace {

geometry::Skeleton SkeletonNamed(const std::string& name_or_file, InputNotes* notes) {
  if (geometry::IsSkeletonFile(name_or_file)) notes->inputs.push_back(name_or_file);
  return geometry::SkeletonFrom(name_or_file);
}

std::optional<geometry::Skeleton> GivenSkeleton(const std::string& name_or_file, InputNotes* notes) {
  if (name_or_file.empty()) return std::nullopt;
  return SkeletonNamed(name_or_file, notes);
}

PoseReading ReadingOf(dataset::Pose2dSet set, InputNotes* notes) {
  ListSkipped(set.skipped, notes);
  for (const dataset::Pose2dTrack& track : set.tracks) ListSkipped(track.skipped, notes);
  return {std::move(set.skeleton), std::move(set.tracks), true, false};
}

PoseReading ReadPoseTable(const PoseArguments& arguments, InputNotes* notes) {
  const auto given = GivenSkeleton(arguments.skeleton, notes);
  dataset::Pose2dSet set = ReadPointsTable(arguments.points2d, given, notes);
  notes->inputs.push_back(arguments.points2d);
  PoseReading reading = ReadingOf(std::move(set), notes);
  reading.whole_table = true;
  return reading;
}

PoseReading ReadTrackers(const PoseArguments& arguments, InputNotes* notes) {
  const auto given = GivenSkeleton(arguments.skeleton, notes);
  dataset::Pose2dSet set = ReadTrackerFiles(arguments.pose2d, given, arguments.bones, notes);
  for (const NamedPath& named : arguments.pose2d) notes->inputs.push_back(named.path);
  return ReadingOf(std::move(set), notes);
}

PoseReading ReadCameraFiles(const PoseArguments& arguments, InputNotes* notes) {
  PoseReading reading;
  reading.skeleton = SkeletonOfFrames(arguments, notes);
  for (const auto& [camera, path] : arguments.pose2d) {
    reading.tracks.push_back(dataset::ReadPose2d(path, camera, reading.skeleton));
    notes->inputs.push_back(path);
    ListSkipped(reading.tracks.back().skipped, notes);
  }
  return reading;
}

bool IsTable(const PoseArguments& arguments) { return !arguments.points2d.empty(); }
bool HasTrackers(const PoseArguments& arguments) { return HasTrackerFile(arguments.pose2d); }
bool HasFrames(const PoseArguments&) { return true; }

/// The first that fits is read.
constexpr struct {
  bool (*fits)(const PoseArguments&);
  PoseReading (*read)(const PoseArguments&, InputNotes*);
} kPoseSources[] = {{IsTable, ReadPoseTable}, {HasTrackers, ReadTrackers}, {HasFrames, ReadCameraFiles}};

}  // namespace

geometry::Skeleton SkeletonOfFrames(const PoseArguments& arguments, InputNotes* notes) {
  if (!arguments.skeleton.empty()) return SkeletonNamed(arguments.skeleton, notes);
  const std::filesystem::path beside = std::filesystem::path(arguments.pose2d.front().path) / ".." / "skeleton.json";
  std::error_code error;
  if (std::filesystem::is_regular_file(beside, error)) return SkeletonNamed(beside.string(), notes);
  const std::optional<geometry::Skeleton> stated = dataset::SkeletonStatedIn(arguments.pose2d.front().path);
  return stated ? *stated : SkeletonNamed("body25", notes);
}

PoseReading ReadPoseSource(const PoseArguments& arguments, InputNotes* notes) {
  CheckNamedOnce(arguments.pose2d);
  const auto source =
      std::find_if(std::begin(kPoseSources), std::end(kPoseSources), [&](const auto& s) { return s.fits(arguments); });
  return source->read(arguments, notes);
}

void ListSkipped(const std::vector<std::string>& skipped, InputNotes* notes) {
  constexpr size_t kShown = 5;
  if (skipped.empty()) return;
  notes->partial = true;
  for (size_t i = 0; i < std::min(skipped.size(), kShown); ++i) {
    notes->warnings.push_back({"POSE-SKIPPED", skipped[i], "the rest was used; run the detector again on these frames"});
  }
  if (skipped.size() > kShown) {
    notes->warnings.push_back({"POSE-SKIPPED", "and " + std::to_string(skipped.size() - kShown) + " more", ""});
  }
}

void CheckNamedOnce(const std::vector<NamedPath>& pose2d) {
  std::set<std::string> seen;
  for (const NamedPath& named : pose2d) {
    if (!seen.insert(named.name).second) throw UsageError("option 'pose2d' names camera " + named.name + " twice");
  }
}

}  // namespace mvstudio::stages
