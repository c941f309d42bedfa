#pragma once

#include <Eigen/Core>

namespace mvstudio::geometry {

/// Twice the area of the triangle (a, b, c), positive where a -> b -> c turns from x to y; an edge function of rasterisation.
/// Its sign is that of the exact value, and 0 means on one line: swapping two points changes the sign and nothing else, so that
/// faces with a common edge neither leave a gap nor overlap. The size is right to a few roundings of the plain formula.
/// Coordinates are 0 or from 1e-100 to 1e100 in size. Shewchuk, "Adaptive precision floating-point arithmetic and fast robust
/// geometric predicates", Discrete & Computational Geometry 18 (1997).
double SignedArea2(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c);

namespace internal {

/// Where the plain formula does not tell the sign.
double ExactSignedArea2(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c);

}  // namespace internal

inline double SignedArea2(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  constexpr double kHalfUlp = 1.1102230246251565e-16, kBound = (3 + 16 * kHalfUlp) * kHalfUlp;
  const double left = (b[0] - a[0]) * (c[1] - a[1]), right = (b[1] - a[1]) * (c[0] - a[0]), area = left - right;
  const double size = (left < 0 ? -left : left) + (right < 0 ? -right : right);
  return area > kBound * size || -area > kBound * size ? area : internal::ExactSignedArea2(a, b, c);
}

}  // namespace mvstudio::geometry
