#pragma once

#include <vector>

#include "calib/intrinsics.h"

namespace mvstudio::calib {

/// Error of a lens model on boards that took no part in its estimation.
struct Holdout {
  Status status = Status::kOk;           ///< kTooFewViews below 3 views
  double rms_px = 0, median_px = 0;      ///< 2-D, over all corners
  std::vector<double> errors_px;         ///< of every corner
  std::vector<double> view_mean_square;  ///< per view, px^2; NaN for views that could not be scored
};

/// K-fold over the views of one camera: intrinsics from the other folds, the pose of a held-out board from every second corner,
/// the error on the other half, then with the halves swapped. Corners that `solution` rejected are left out. Up to `max_views`
/// views, evenly spread, are used.
Holdout HoldoutError(const MonoSolution& solution, geometry::LensModel model, int num_folds, int max_views);

}  // namespace mvstudio::calib
