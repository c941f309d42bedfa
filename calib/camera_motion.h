#pragma once

#include <vector>

#include "calib/calibrate.h"
#include "geometry/rig.h"

/// Did a camera move while the boards were filmed?
namespace mvstudio::calib {

/// The recording is cut into up to 12 stretches of time; each camera gets a pose in each, lenses and the other cameras held, boards
/// free. The cut at which the poses before and after differ most for what they scatter among themselves is the motion. The camera
/// whose motion explains most comes first and loses its vote on the others before these are asked again. `rig` is the calibration
/// from the same corners; motions below 5 standard deviations, or below 0.3 px and one standard deviation of the camera's corners
/// in the image, are let pass. In the order in which they were found.
std::vector<CameraMotion> FindMotions(const geometry::Rig& rig, const CalibrateInput& input);

}  // namespace mvstudio::calib
