#pragma once

#include <vector>

#include "calib/board/board.h"
#include "calib/calibrate.h"

namespace mvstudio::stages {

/// What more boards would be worth to one camera.
struct FilmGain {
  int camera_idx = 0;
  std::vector<geometry::Rigid3> cam_from_board;  ///< the boards that were assumed: one for each image
  double before_px = 0, after_px = 0;            ///< as CameraUncertainty::corner_px, and with these boards as well
};

/// For cameras whose images lack corners (FILM-COVERAGE, FILM-FEW): six boards of the first kind, seen by that camera alone in
/// the parts of its image that hold the fewest, tilted by turns. The uncertainty comes from the normal equations with the
/// corners of these boards added, at the report's solution. Where it is tens of px, the lens itself is that far off, and such
/// boards gain more than is predicted. Empty for clocks with offsets, boards that move against each other and lenses alone,
/// where the report does not hold all that counts; cameras that
/// these boards would not help are left out.
std::vector<FilmGain> PredictGain(const calib::CalibrateReport& report, const std::vector<calib::Board>& boards);

}  // namespace mvstudio::stages
