#pragma once

namespace mvstudio::calib {

/// COLMAP, nerfstudio and AprilTag count pixels from the corner of the image, so that the centre of the top-left pixel is (0.5,
/// 0.5); here (and in OpenCV, mrcal, Kalibr) it is (0, 0). px_from_corner = px + kCornerOriginShiftPx.
inline constexpr double kCornerOriginShiftPx = 0.5;

}  // namespace mvstudio::calib
