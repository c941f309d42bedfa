#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "core/random.h"
#include "core/units.h"
#include "geometry/rig/rig.h"
#include "triangulate/point/point.h"

/// Synthetic rigs and observations for the tests of triangulate/.
namespace mvstudio::triangulate {

inline geometry::RigCamera LookAt(const std::string& name, const Eigen::Vector3d& center, const Eigen::Vector3d& target,
                                  double focal_px = 1000, int width_px = 1280, int height_px = 960) {
  const Eigen::Vector3d z = (target - center).normalized();
  const Eigen::Vector3d up = std::abs(z.z()) > 0.99 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d x = z.cross(up).normalized();
  Eigen::Matrix3d cam_from_world;
  cam_from_world << x.transpose(), z.cross(x).transpose(), z.transpose();
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole(name, width_px, height_px, focal_px);
  camera.cam_from_world.rotation = Eigen::Quaterniond(cam_from_world).normalized();
  camera.cam_from_world.translation = -(camera.cam_from_world.rotation * center);
  return camera;
}

/// Cameras on a circle around `middle`, at heights that alternate, looking at it through Brown lenses.
inline geometry::Rig MakeRing(int num_cameras, double radius_m = 3, const Eigen::Vector3d& middle = Eigen::Vector3d::Zero()) {
  geometry::Rig rig;
  for (int i = 0; i < num_cameras; ++i) {
    const double angle = 2 * kPi * i / num_cameras;
    const Eigen::Vector3d offset(radius_m * std::cos(angle), radius_m * std::sin(angle), i % 2 ? 1.2 : 0.1);
    rig.cameras.push_back(LookAt("cam_" + std::to_string(i), middle + offset, middle));
    geometry::Camera& lens = rig.cameras.back().camera;
    const Eigen::Vector4d pinhole = lens.params.head<4>();
    lens.model = geometry::LensModel::kBrown5;
    lens.params.resize(9);
    lens.params << pinhole, -0.2, 0.1, 1e-3, -5e-4, -0.02;
  }
  return rig;
}

inline Eigen::Vector3d RandomPoint(Rng* rng, double half_size_m = 0.6) {
  return {rng->Uniform(-half_size_m, half_size_m), rng->Uniform(-half_size_m, half_size_m),
          rng->Uniform(-half_size_m, half_size_m)};
}

/// What every camera sees of a point, with Gaussian noise. Cameras that cannot see it are left out.
inline std::vector<Observation> Observe(const geometry::Rig& rig, const Eigen::Vector3d& x_in_world, double noise_px = 0,
                                        Rng* rng = nullptr, double sigma_px = 1) {
  std::vector<Observation> observations;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const auto projection = geometry::Project(rig.cameras[c].camera, rig.cameras[c].cam_from_world * x_in_world);
    if (projection.status != Status::kOk) continue;
    Observation seen{static_cast<int>(c), projection.px, sigma_px, 1.0};
    if (rng) seen.px += noise_px * Eigen::Vector2d(rng->Normal(), rng->Normal());
    observations.push_back(seen);
  }
  return observations;
}

/// Two pinhole cameras at `distance_m` from the origin whose rays to it enclose `angle_rad`.
inline geometry::Rig TwoCameras(double angle_rad, double distance_m = 3, double focal_px = 1000) {
  geometry::Rig rig;
  for (const double side : {-0.5, 0.5}) {
    const double a = side * angle_rad;
    rig.cameras.push_back(LookAt(side < 0 ? "left" : "right", distance_m * Eigen::Vector3d(std::cos(a), std::sin(a), 0),
                                 Eigen::Vector3d::Zero(), focal_px));
  }
  return rig;
}

inline std::filesystem::path DataFolder() {
  if (const char* data = std::getenv("MVSTUDIO_DATA")) return data;
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  return std::filesystem::path(source ? source : ".") / ".." / "shared" / "data";
}

}  // namespace mvstudio::triangulate
