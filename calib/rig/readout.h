#pragma once

#include <limits>
#include <vector>

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// How long a camera takes from its first row to its last (rolling shutter).
struct Readout {
  double frames = 0;  ///< readout time over the time between two frames; negative when the last row is read first
  double sigma_frames = std::numeric_limits<double>::infinity();
  double shift_px = 0;  ///< rms displacement of the camera's corners by the readout
};

/// Rolling-shutter readout per camera, from the residuals at a solution without it: a corner's residual is the board's
/// motion between the readout of the middle row and that of the corner's row. Only the part of this motion that no board
/// pose explains is used. Boards without an observed neighbouring frame are ignored; cameras without any other have an
/// infinite sigma. `sigma_px` is that of a corner of weight 1. First-order: Meingast, Geyer, Sastry, "Geometric models of
/// rolling-shutter cameras", OMNIVIS 2005.
std::vector<Readout> EstimateReadout(const std::vector<View>& views, const RigState& state, double sigma_px);

}  // namespace mvstudio::calib
