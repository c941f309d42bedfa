#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dataset/pose/pose2d.h"
#include "stages/input_notes.h"
#include "stages/words.h"

/// 2D points in the files of DeepLabCut, SLEAP and caliscope (dataset/trackers/tracker_file.h), as commands take them.
namespace mvstudio::stages {

using NamedBones = std::vector<std::pair<std::string, std::string>>;

/// True when one of the files is a tracker's.
bool HasTrackerFile(const std::vector<NamedPath>& pose2d);

/// Reads a tracker's file for every camera. The skeleton is the one given, else the joints of all files together, with the
/// bones that a file states, else the project's. Says which joints some cameras lack, and that several
/// individuals are matched by geometry. Throws UsageError when only some cameras' files are a tracker's.
dataset::Pose2dSet ReadTrackerFiles(const std::vector<NamedPath>& pose2d, const std::optional<geometry::Skeleton>& given,
                                    const NamedBones& of_project, InputNotes* notes);

/// Reads a table of all cameras, in the skeleton given, else that of the joints it names: ours or caliscope's. Throws
/// FormatError for one camera's file, with the option that takes it.
dataset::Pose2dSet ReadPointsTable(const std::string& path, const std::optional<geometry::Skeleton>& given, InputNotes* notes);

}  // namespace mvstudio::stages
