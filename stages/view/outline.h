#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/image.h"

namespace mvstudio::stages {

/// Corners of a closed line, px; (0, 0) is the centre of the top-left pixel.
using OutlinePx = std::vector<Eigen::Vector2d>;

/// The borders of the foreground (above 127) of a mask with one channel, along the edges of its pixels; holes have lines of
/// their own. Corners within `tolerance_px` of the line between those that stay are left out (Douglas and Peucker,
/// "Algorithms for the reduction of the number of points", 1973), and so are lines of which less than a triangle stays.
std::vector<OutlinePx> OutlinesOf(const Image& mask, double tolerance_px);

/// 255 in triangles of these corners, 0 elsewhere: pixels whose centre lies inside. `px` (2, V); triangles with a corner that
/// is not finite are left out. Source of the rule: Pineda, "A parallel algorithm for polygon rasterization", SIGGRAPH 1988.
Image TriangleMask(const Eigen::Matrix2Xd& px, const Eigen::Matrix3Xi& faces, int width, int height);

}  // namespace mvstudio::stages
