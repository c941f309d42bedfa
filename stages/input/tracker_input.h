#pragma once

#include <string>
#include <vector>

#include "dataset/pose/pose2d.h"
#include "stages/input/pose_input.h"

/// 2D points in the files of DeepLabCut, SLEAP and caliscope (dataset/trackers/tracker_file.h), as commands take them.
namespace mvstudio::stages {

/// True when one of the files is a tracker's.
bool HasTrackerFile(const std::vector<NamedPath>& pose2d);

/// Reads a tracker's file, one of `arguments.pose2d`, for every camera. The skeleton is the one given, else the joints of all
/// files together, with the bones that a file states, else the project's. Says which joints some cameras lack, and that several
/// individuals are matched by geometry. Throws UsageError when only some cameras' files are a tracker's.
dataset::Pose2dSet ReadTrackerFiles(const PoseArguments& arguments, InputNotes* notes);

/// Reads option `points2d`: our table or caliscope's. Throws FormatError for one camera's file, with the option that takes
/// it.
dataset::Pose2dSet ReadPointsTable(const std::string& path, const std::string& skeleton, InputNotes* notes);

}  // namespace mvstudio::stages
