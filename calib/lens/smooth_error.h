#pragma once

#include <vector>

#include "calib/bundle/view.h"

namespace mvstudio::calib {

/// RMS (px, 2-D) of a camera's residuals (2, N a view) without the part that varies smoothly over each view, a cubic
/// polynomial of the board's coordinates. A wrong lens, and a board of other proportions, leave smooth residuals: what is left
/// here is the detector's noise. Corrected for the polynomials' parameters. Views of fewer than 24 corners with a weight are
/// left out; NaN without any other.
double SmoothErrorPx(const std::vector<View>& views, const std::vector<Eigen::Matrix2Xd>& residuals_px, int camera_idx);

}  // namespace mvstudio::calib
