#pragma once

namespace mvstudio::calib {

/// Shift between pixel origins. COLMAP, nerfstudio and AprilTag put the centre of the top-left pixel at (0.5, 0.5); here,
/// as in OpenCV, mrcal and Kalibr, it is (0, 0). px_from_corner = px + kCornerOriginShiftPx.
inline constexpr double kCornerOriginShiftPx = 0.5;

}  // namespace mvstudio::calib
