#pragma once

#include <vector>

#include "core/image.h"
#include "dataset/pose/pose2d.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::detect {

/// The image with bones drawn over it: left red, right green, the middle yellow. Joints that score less than `min_score`
/// are left out.
Image DrawPoses(const Image& rgb, const std::vector<dataset::Person2d>& people, const geometry::Skeleton& skeleton,
                double min_score = 0.1);

}  // namespace mvstudio::detect
