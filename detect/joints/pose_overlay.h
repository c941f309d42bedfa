#pragma once

#include <vector>

#include "body/skeleton.h"
#include "core/image.h"
#include "dataset/pose/pose2d.h"

namespace mvstudio::detect {

/// The image with bones drawn over it: left red, right green, the middle yellow. Joints that score less than `min_score`
/// are left out.
Image DrawPoses(const Image& rgb, const std::vector<dataset::Person2d>& people, const body::Skeleton& skeleton,
                double min_score = 0.1);

}  // namespace mvstudio::detect
