#pragma once

#include "core/progress.h"
#include "geometry/rig/rig.h"
#include "stages/calibrate/run.h"

/// Calibration without footage of a board: marked points, or images of the scene itself.
namespace mvstudio::stages {

/// Marked points as a board of points that every camera saw in frame 0. Sizes of images are 0 where `sizes` do not state them.
calib::CalibrateInput PointsAsBoard(const calib::ScenePoints& points, const std::vector<calib::CameraSize>& sizes);

/// CalibrateReport::found and path, of the scene when it is given, else of marked points alone. `lenses` are those that are
/// known. The first board that is named is looked for in the scene's images and gives place and scale.
void CalibrateOnScene(const geometry::Rig& lenses, const RunContext& run, CalibrateReport* report);

}  // namespace mvstudio::stages
