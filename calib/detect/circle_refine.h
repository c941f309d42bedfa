#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/board/board.h"
#include "calib/detect/circle_search.h"
#include "core/image.h"
#include "core/status.h"

namespace mvstudio::calib {

/// A spot as its blurred outline fits the grey values.
struct FittedSpot {
  Status status = Status::kOk;  ///< kOutlier when the grey values do not fit; kTooFewViews when it is too small
  Spot spot;
  double sigma_px = 0;  ///< standard deviation of the centre per coordinate
};

/// Fits an ellipse with a blurred edge (centre, shape, blur, two levels, brightness slope) to the grey values around the
/// outline by least squares.
FittedSpot FitSpot(const Image& grey, const Spot& start, double max_misfit);

/// Where the centres of the circles are seen, (2, N). The image of a circle's centre is not the centre of its image: of a
/// tilted board they lie up to a fraction of a pixel apart. `on_board`: (2, N) centres, metres; `spots`: their images. The
/// smooth image of the board's plane (PlaneToImage) maps a circle of the common radius, and the distance of its centroid from
/// its centre's image is taken off. Nothing changes where no plane fits.
Eigen::Matrix2Xd CentresSeen(const Eigen::Matrix2Xd& on_board, const std::vector<Spot>& spots);

}  // namespace mvstudio::calib
