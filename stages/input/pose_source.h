#pragma once

#include <string>
#include <vector>

#include "dataset/pose/pose2d.h"
#include "stages/input/pose_input.h"

/// Files with 2D joints, as their programs wrote them: nothing is renumbered, rescaled or left out here.
namespace mvstudio::stages {

struct PoseReading {
  geometry::Skeleton skeleton;
  std::vector<dataset::Pose2dTrack> tracks;  ///< one per camera
  bool joints_by_name = false;  ///< joints are found by their names, so that a given skeleton may have some that no file gives
  bool whole_table = false;     ///< all cameras stand in one table
};

/// The skeleton given by name or file; else the skeleton.json that `mvstudio pose2d` writes beside the cameras' folders, else
/// the joints that the first file names, else body25. A file becomes an input.
geometry::Skeleton SkeletonOfFrames(const PoseArguments& arguments, InputNotes* notes);

/// Finds which kind of source the arguments name and reads it; the files become inputs, what they lack is listed. Throws
/// UsageError, IoError, FormatError.
PoseReading ReadPoseSource(const PoseArguments& arguments, InputNotes* notes);

/// Lists files and rows that were left out; they make the input partial (exit 6).
void ListSkipped(const std::vector<std::string>& skipped, InputNotes* notes);

/// Throws UsageError where a camera is named twice.
void CheckNamedOnce(const std::vector<NamedPath>& pose2d);

}  // namespace mvstudio::stages
