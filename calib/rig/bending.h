#pragma once

#include <vector>

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// Variation of the boards' warp between time steps.
struct BoardBending {
  double rms_m = 0;           ///< at the middle of the board, beyond the level of noise
  double variance_ratio = 1;  ///< variance of the warps over that expected from noise; 1: no variation
  double sigmas = 0;          ///< standard deviations by which the ratio exceeds 1
  int num_frames = 0;         ///< frames used
};

/// Fits the two warp coefficients (WarpBasis) to the residuals of each time step, with the board's pose free. For a rigid
/// board, the squared coefficients over their variances are chi-squared with two degrees of freedom. `sigma_px` is that of
/// a corner of weight 1.
BoardBending EstimateBending(const std::vector<View>& views, const RigState& state, double sigma_px);

}  // namespace mvstudio::calib
