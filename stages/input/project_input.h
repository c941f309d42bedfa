#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dataset/trackers/tracked_project.h"
#include "stages/input/pose_input.h"
#include "stages/input/session_input.h"

namespace mvstudio::stages {

inline constexpr char kProjectHelp[] =
    "folder of an anipose, caliscope or Pose2Sim project instead: calibration and 2D points come from it; option 'take' names "
    "one of its takes";

/// What a project is, and what it asks for beside its files.
struct ProjectInput {
  std::string program, take;  ///< names
  bool filtered = false;      ///< the 2D points are the program's filtered ones
  dataset::ProjectSettings settings;
  std::vector<std::string> notes;  ///< how settings were understood, in sentences
};

/// metrics["project"]: program, take, filtered.
nlohmann::ordered_json ProjectJson(const ProjectInput& project);

/// Fills calibration, 2D points, skeleton and frames, unless given, from a folder of anipose, caliscope or Pose2Sim
/// (dataset/trackers/tracked_project.h), and returns what else it asks for. Sets the unit
/// of anipose's calibration unless given: metres for a board with squares below 1, else millimetres, which is said. Files
/// that were left out become warnings. `session` names the take. Throws UsageError when 2D points or a session are given
/// beside it.
ProjectInput FillFromProject(const std::string& folder, const SessionArguments& session, PoseArguments* pose,
                             InputNotes* notes);

}  // namespace mvstudio::stages
