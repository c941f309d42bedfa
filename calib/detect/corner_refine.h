#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/board/board.h"
#include "core/image.h"
#include "core/status.h"

namespace mvstudio::calib {

/// A board corner to be located, with the board's local geometry in the image.
struct CornerGuess {
  int corner_id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();       ///< accurate to a fraction of a square
  Eigen::Vector2d along_x = Eigen::Vector2d::Zero();  ///< px per square along the board's x at the corner
  Eigen::Vector2d along_y = Eigen::Vector2d::Zero();
};

struct RefinedCorner {
  Status status = Status::kOk;  ///< kOutlier when the grey values do not fit that corner; kOutsideValidRadius at the border
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0;  ///< standard deviation per coordinate, from the fit to the grey values
  double misfit = 0;    ///< rms grey-value residual over the contrast of the corner
};

struct RefineOptions {
  double max_radius_px = 9;  ///< half window; a larger one averages more noise but includes more lens curvature
  double max_misfit = 0.2;   ///< of the contrast
  double min_contrast = 12;  ///< grey levels between black and white
  int max_iterations = 20;
};

/// Locates a corner to a few hundredths of a pixel. Two crossing blurred edges (position, two directions, blur, black and
/// white level, brightness slope) are fitted to the grey values around it by least squares. Pixels on markers are
/// excluded.
RefinedCorner RefineCorner(const Board& board, const Image& grey, const CornerGuess& guess, const RefineOptions& options = {});

}  // namespace mvstudio::calib
