#pragma once

#include <Eigen/Dense>
#include <vector>

#include "geometry/lens/camera_model.h"
#include "geometry/rig/rig.h"
#include "tests/support/mp.h"
#include "triangulate/point/types.h"

/// Triangulation in numbers of 60 digits, straight from the definitions and from the rig's own numbers.
namespace mvstudio::triangulate::oracle {

using testing::Mp;
using Vector2 = Eigen::Matrix<Mp, 2, 1>;
using Vector3 = Eigen::Matrix<Mp, 3, 1>;
using Matrix3 = Eigen::Matrix<Mp, 3, 3>;

inline Vector3 ToMp(const Eigen::Vector3d& x) { return {Mp(x.x()), Mp(x.y()), Mp(x.z())}; }
inline Eigen::Vector3d ToDouble(const Vector3& x) {
  return {static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2])};
}

inline Matrix3 Rotation(const geometry::Rigid3& pose) {
  Eigen::Quaternion<Mp> q(Mp(pose.rotation.w()), Mp(pose.rotation.x()), Mp(pose.rotation.y()), Mp(pose.rotation.z()));
  return q.normalized().toRotationMatrix();
}

inline Vector3 ToCam(const geometry::RigCamera& camera, const Vector3& x_in_world) {
  return Rotation(camera.cam_from_world) * x_in_world + ToMp(camera.cam_from_world.translation);
}

inline Vector3 Center(const geometry::RigCamera& camera) {
  return -(Rotation(camera.cam_from_world).transpose() * ToMp(camera.cam_from_world.translation));
}

inline bool Project(const geometry::RigCamera& camera, const Vector3& x_in_world, Vector2* px) {
  std::vector<Mp> params;
  for (const double p : camera.camera.params) params.push_back(Mp(p));
  return geometry::ProjectByFormula<Mp>(camera.camera.model, params.data(), ToCam(camera, x_in_world), px);
}

struct Optimum {
  Vector3 x_in_world;
  Matrix3 information;
  Mp chi_squared = 0;
};

/// Least squares of (projection - px) / sigma by Gauss-Newton from `start`, derivatives by central differences of 1e-25.
inline Optimum MostLikely(const geometry::Rig& rig, const std::vector<Observation>& observations, const Eigen::Vector3d& start,
                          int num_steps = 40) {
  const Mp h("1e-25");
  Optimum at;
  at.x_in_world = ToMp(start);
  for (int step = 0; step <= num_steps; ++step) {
    at.information.setZero();
    at.chi_squared = 0;
    Vector3 gradient = Vector3::Zero();
    for (const Observation& seen : observations) {
      const geometry::RigCamera& camera = rig.cameras[seen.camera_idx];
      const Mp sigma(seen.sigma_px);
      Vector2 px, up, down;
      Project(camera, at.x_in_world, &px);
      const Vector2 residual((px[0] - Mp(seen.px[0])) / sigma, (px[1] - Mp(seen.px[1])) / sigma);
      Eigen::Matrix<Mp, 2, 3> jacobian;
      for (int k = 0; k < 3; ++k) {
        Vector3 shift = Vector3::Zero();
        shift[k] = h;
        Project(camera, Vector3(at.x_in_world + shift), &up);
        Project(camera, Vector3(at.x_in_world - shift), &down);
        for (int i = 0; i < 2; ++i) jacobian(i, k) = (up[i] - down[i]) / (Mp(2) * h * sigma);
      }
      at.information += jacobian.transpose() * jacobian;
      gradient += jacobian.transpose() * residual;
      at.chi_squared += residual.dot(residual);
    }
    if (step == num_steps) break;
    const Vector3 move = at.information.inverse() * gradient;
    at.x_in_world -= move;
    if (move.norm() < Mp("1e-30")) num_steps = step + 1;
  }
  return at;
}

}  // namespace mvstudio::triangulate::oracle
