// Private: for the .cc files of the masks.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <utility>

#include "dataset/masks/masks.h"

/// The limbs of a person in an image: their shape, the distance to them, the box around them.
namespace mvstudio::dataset::internal {

struct LimbShape {
  int a, b;
  double radius_a_m, radius_b_m;
};

/// Radii of a clothed adult; indices are Panoptic's joints.
inline constexpr LimbShape kLimbs[] = {
    {0, 2, 0.13, 0.13},   {3, 9, 0.08, 0.08},     {6, 12, 0.11, 0.11},   {3, 6, 0.07, 0.10},     {9, 12, 0.07, 0.10},
    {3, 4, 0.060, 0.045}, {4, 5, 0.045, 0.035},   {9, 10, 0.060, 0.045}, {10, 11, 0.045, 0.035}, {6, 7, 0.090, 0.060},
    {7, 8, 0.060, 0.045}, {12, 13, 0.090, 0.060}, {13, 14, 0.060, 0.045}};

/// Bones whose line is certainly foreground; without the face, whose joints lie near the outline.
inline constexpr std::pair<int, int> kBones[] = {{0, 1},   {0, 2}, {0, 3}, {3, 4}, {4, 5},  {0, 9},   {9, 10},
                                                 {10, 11}, {2, 6}, {6, 7}, {7, 8}, {2, 12}, {12, 13}, {13, 14}};

struct LimbDistance {
  double outside_m = std::numeric_limits<double>::infinity();  ///< to the nearest limb's surface, negative inside
  double relative = std::numeric_limits<double>::infinity();   ///< to the nearest limb's axis over its radius
};
LimbDistance DistanceToBody(const ProjectedBody& body, const Eigen::Vector2d& px);

/// Mean over the limbs; the body must not be empty.
double TypicalPxPerM(const ProjectedBody& body);

/// Half-open pixel ranges.
struct PixelBox {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  bool empty() const { return width() <= 0 || height() <= 0; }
};
/// Bounding box of the region within `margin_m` of the limbs, clipped to the image.
PixelBox BoxOfBody(const ProjectedBody& body, int width, int height, double margin_m);

}  // namespace mvstudio::dataset::internal
