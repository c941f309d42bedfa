#pragma once

#include <vector>

#include "body/skeleton.h"
#include "calib/keypoints/place.h"

namespace mvstudio::app {

/// Lengths by which the size of a rig can be told: those that the skeleton states (the middle of each range), else a
/// person's thighs, shanks, upper arms and forearms as shares of the height (Drillis and Contini, "Body Segment
/// Parameters", 1966: 0.245, 0.246, 0.186, 0.146). People differ from these shares by some per cent. Empty: neither.
std::vector<calib::KnownLength> KnownLengthsOf(const body::Skeleton& skeleton, double person_height_m);

}  // namespace mvstudio::app
