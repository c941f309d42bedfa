#pragma once

#include <vector>

#include "calib/keypoints/place.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::stages {

/// Lengths by which the size of a rig can be told: those that the skeleton states (the middle of each range), else a
/// person's thighs, shanks, upper arms and forearms as shares of the height (Drillis and Contini, "Body Segment
/// Parameters", 1966: 0.245, 0.246, 0.186, 0.146). People differ from these shares by some per cent. Empty: neither.
std::vector<calib::KnownLength> KnownLengthsOf(const geometry::Skeleton& skeleton, double person_height_m);

}  // namespace mvstudio::stages
