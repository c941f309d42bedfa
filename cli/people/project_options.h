#pragma once

#include <set>
#include <string>

#include "dataset/trackers/tracked_project.h"
#include "geometry/rig/rig.h"
#include "stages/people/marker_export.h"
#include "stages/result.h"
#include "triangulate/take/take.h"

/// What `--project` says beside its files.
namespace mvstudio::cli {

/// What the project asks of the points and of marker files, where no option was typed for it (`given`: "--min-score", …). Where
/// it asks for a filter or for filled gaps and states a frame rate, it gets .trc files, as Pose2Sim writes them. Adds metrics
/// `project.settings` and a line of text.
void ApplyProject(const dataset::ProjectSettings& settings, const std::set<std::string>& given, triangulate::TakeOptions* take,
                  stages::MarkerOptions* markers, stages::CommandResult* result);

/// Moves the points into the world of the project's axes, and writes the calibration in that world (calibration.json) and the
/// project's angles (angles.csv) into `out`. Nothing where it asks for neither.
void WriteProjectParts(const dataset::ProjectSettings& settings, const geometry::Rig& rig, const std::string& project,
                       const std::string& out, dataset::Pose3d* pose, stages::CommandResult* result);

}  // namespace mvstudio::cli
