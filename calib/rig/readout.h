#pragma once

#include <limits>
#include <vector>

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// How long a camera takes from its first row to its last (rolling shutter).
struct Readout {
  double frames = 0;  ///< of the time between two frames; negative when it begins with the last row
  double sigma_frames = std::numeric_limits<double>::infinity();
  double shift_px = 0;  ///< rms over the camera's corners of what that moves them by
};

/// Per camera, from the residuals at a solution that knows of no rolling shutter: a corner's residual is what the board moved by
/// between the middle row and the corner's. Of that movement only what no pose of the board explains is compared. Boards that no
/// neighbouring frame shows say nothing; cameras without others have an infinite sigma. `sigma_px` is that of a corner of weight
/// 1. First-order: Meingast, Geyer, Sastry, "Geometric models of rolling-shutter cameras", OMNIVIS 2005.
std::vector<Readout> EstimateReadout(const std::vector<View>& views, const RigState& state, double sigma_px);

}  // namespace mvstudio::calib
