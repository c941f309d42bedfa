// Private: one Gaussian on its triangle, for project.cc, gradients.cc and their like.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "avatar/splats/project.h"
#include "core/status.h"

namespace mvstudio::splats {

template <class S>
using Vec3 = Eigen::Matrix<S, 3, 1>;
template <class S>
using Mat3 = Eigen::Matrix<S, 3, 3>;

/// Where a Gaussian is in the world.
template <class S>
struct Placed {
  Status status = Status::kOk;
  Mat3<S> world_from_face;  // rotation
  Vec3<S> edge1, edge2;     // x1 - x0, x2 - x0
  Vec3<S> mean;             // metres
};

/// Smallest area of a triangle, m^2; smaller ones have no frame.
inline constexpr double kLeastArea = 1e-12;

template <class S>
Placed<S> PlaceSplat(const BasicCloud<S>& cloud, size_t i, const Surface<S>& surface) {
  Placed<S> p;
  const int face = cloud.face[i];
  const Vec3<S> x0 = surface.vertices.col(surface.faces(0, face));
  p.edge1 = surface.vertices.col(surface.faces(1, face)) - x0;
  p.edge2 = surface.vertices.col(surface.faces(2, face)) - x0;
  const Vec3<S> cross = p.edge1.cross(p.edge2);
  const S twice_area = cross.norm();
  const S* place = cloud.values.place.data() + 2 * i;
  if (!std::isfinite(twice_area) || !x0.allFinite()) {
    p.status = Status::kNonFiniteInput;
    return p;
  }
  if (!(twice_area > S(2 * kLeastArea))) {
    p.status = Status::kDegenerate;
    return p;
  }
  p.world_from_face.col(2) = cross / twice_area;
  p.world_from_face.col(0) = p.edge1.normalized();
  p.world_from_face.col(1) = p.world_from_face.col(2).cross(p.world_from_face.col(0));
  p.mean = x0 + place[0] * p.edge1 + place[1] * p.edge2 + cloud.values.offset[i] * p.world_from_face.col(2);
  if (!p.mean.allFinite()) p.status = Status::kNonFiniteInput;
  return p;
}

/// Rotation matrix of a quaternion x, y, z, w of length 1.
template <class S>
Mat3<S> MatrixOf(const Eigen::Matrix<S, 4, 1>& q) {
  return Eigen::Quaternion<S>(q[3], q[0], q[1], q[2]).toRotationMatrix();
}

/// Derivative of a function of that matrix with respect to the quaternion's numbers, from that with respect to the matrix.
template <class S>
Eigen::Matrix<S, 4, 1> QuaternionGradient(const Eigen::Matrix<S, 4, 1>& q, const Mat3<S>& d) {
  const S x = q[0], y = q[1], z = q[2], w = q[3];
  Eigen::Matrix<S, 4, 1> g;
  g[0] = 2 * (y * (d(0, 1) + d(1, 0)) + z * (d(0, 2) + d(2, 0)) + w * (d(2, 1) - d(1, 2))) - 4 * x * (d(1, 1) + d(2, 2));
  g[1] = 2 * (x * (d(0, 1) + d(1, 0)) + z * (d(1, 2) + d(2, 1)) + w * (d(0, 2) - d(2, 0))) - 4 * y * (d(0, 0) + d(2, 2));
  g[2] = 2 * (x * (d(0, 2) + d(2, 0)) + y * (d(1, 2) + d(2, 1)) + w * (d(1, 0) - d(0, 1))) - 4 * z * (d(0, 0) + d(1, 1));
  g[3] = 2 * (x * (d(2, 1) - d(1, 2)) + y * (d(0, 2) - d(2, 0)) + z * (d(1, 0) - d(0, 1)));
  return g;
}

}  // namespace mvstudio::splats
