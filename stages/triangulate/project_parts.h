#pragma once

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"
#include "stages/input/project_input.h"
#include "stages/input_notes.h"
#include "stages/people/marker_export.h"
#include "triangulate/take/take.h"

/// What option 'project' says beside its files.
namespace mvstudio::stages {

struct ProjectUse {
  ProjectInput input;
  std::vector<std::pair<std::string, std::string>> settings;  ///< options that it set, and their values
  std::string world;                                          ///< of its axes; empty: it asks for none
  std::string calibration, angles;                            ///< paths that were written; empty: none
};

/// What the project asks of the points and of marker files, for options that nobody chose (not in `given`). Where it asks for a
/// filter or for filled gaps and states a frame rate, it gets .trc files, as Pose2Sim writes them.
ProjectUse UseProject(ProjectInput project, const std::set<std::string>& given, triangulate::TakeOptions* take,
                      MarkerOptions* markers, InputNotes* notes);

/// Whether the project writes a file of its own, by its name: calibration.json, angles.csv.
std::vector<std::string> ProjectFiles(const dataset::ProjectSettings& settings);

/// Moves the points into the world of the project's axes, and writes the calibration in that world (calibration.json) and the
/// project's angles (angles.csv) into `out`. Nothing where it asks for neither.
void WriteProjectParts(const geometry::Rig& rig, const std::string& project, const std::string& out, dataset::Pose3d* pose,
                       ProjectUse* use);

}  // namespace mvstudio::stages
