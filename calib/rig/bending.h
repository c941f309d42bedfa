#pragma once

#include <vector>

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// How much the boards' bend differs from one time step to the next.
struct BoardBending {
  double rms_m = 0;           ///< at the middle of the board, beyond what noise explains
  double variance_ratio = 1;  ///< of the bends by themselves over what noise explains; 1: no bending
  double sigmas = 0;          ///< by which the ratio exceeds 1
  int num_frames = 0;         ///< that take part
};

/// The residuals of each time step are compared with the two bends of the board (WarpBasis), its pose free. Without bending, the squared
/// bends over their variances are chi-squared distributed with two degrees of freedom. `sigma_px` is that of a corner of weight 1.
BoardBending EstimateBending(const std::vector<View>& views, const RigState& state, double sigma_px);

}  // namespace mvstudio::calib
