#pragma once

#include <string>

#include "dataset/trackers/tracked_project.h"
#include "stages/input/pose_input.h"
#include "stages/input/session_input.h"

namespace mvstudio::stages {

/// Fills calibration, 2D points, skeleton and frames, unless given, from a folder of anipose, caliscope or Pose2Sim
/// (dataset/trackers/tracked_project.h), and returns what else it asks for. Sets the unit
/// of anipose's calibration unless given: metres for a board with squares below 1, else millimetres, which is said. Files
/// that were left out become warnings. `session` names the take. Throws UsageError when 2D points or a session are given
/// beside it.
dataset::ProjectSettings FillFromProject(const std::string& folder, const SessionArguments& session, PoseArguments* pose,
                                         CommandResult* result);

}  // namespace mvstudio::stages
