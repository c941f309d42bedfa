#pragma once

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "calib/keypoints/take.h"
#include "core/random.h"
#include "core/units.h"
#include "geometry/rig/rig.h"
#include "tests/calib/synthetic.h"

/// Synthetic people seen by a synthetic rig, for the tests of calib/keypoints/.
namespace mvstudio::calib::testing {

/// Cameras on a circle of 4 m, at two heights, looking at the middle.
inline geometry::Rig PeopleRig(int num_cameras, geometry::LensModel model = geometry::LensModel::kBrown2,
                               const Eigen::Vector3d& middle = Eigen::Vector3d::Zero()) {
  geometry::Rig rig;
  for (int c = 0; c < num_cameras; ++c) {
    const double angle = 2 * kPi * c / num_cameras + 0.2;
    geometry::RigCamera camera;
    camera.camera = MakeCamera("cam" + std::to_string(c), model, 900);
    camera.camera.width_px = 1280, camera.camera.height_px = 960;
    camera.camera.params.segment<2>(2) << 645, 471;
    camera.cam_from_world = LookAt(middle + Eigen::Vector3d(4 * std::cos(angle), 4 * std::sin(angle), c % 2 ? 1.6 : 0.6),
                                   middle + Eigen::Vector3d(0, 0, 0.2));
    rig.cameras.push_back(camera);
  }
  return rig;
}

struct PeopleOptions {
  int num_frames = 40, num_joints = 12;
  double noise_px = 1.5, outlier_fraction = 0.03, reach_m = 1.2;
  uint64_t seed = 1;
};

/// A person whose joints keep their places in a body that walks about within `reach_m` of the middle.
inline std::vector<triangulate::DetectedFrame> FilmPeople(const geometry::Rig& rig, const PeopleOptions& options,
                                                          const Eigen::Vector3d& middle = Eigen::Vector3d::Zero()) {
  Rng rng(options.seed);
  Eigen::Matrix3Xd body = Eigen::Matrix3Xd::NullaryExpr(3, options.num_joints, [&] { return rng.Uniform(-1, 1); });
  body.topRows<2>() *= 0.25, body.row(2) *= 0.8;
  std::vector<triangulate::DetectedFrame> frames;
  for (int f = 0; f < options.num_frames; ++f) {
    const double t = 0.35 * f;
    const Eigen::Vector3d place(options.reach_m * std::sin(0.7 * t), options.reach_m * std::cos(0.43 * t),
                                0.2 * options.reach_m * std::sin(1.1 * t));
    const Eigen::Quaterniond turn = geometry::RotationExp({0.2 * std::sin(t), 0.2 * std::cos(0.6 * t), 0.5 * t});
    triangulate::DetectedFrame frame{f, std::vector<std::vector<triangulate::DetectedPerson>>(rig.cameras.size())};
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      triangulate::DetectedPerson person;
      for (int j = 0; j < options.num_joints; ++j) {
        const Eigen::Vector3d x = middle + place + turn * Eigen::Vector3d(body.col(j));
        const auto projection = geometry::Project(rig.cameras[c].camera, rig.cameras[c].cam_from_world * x);
        const bool gross = rng.Uniform() < options.outlier_fraction;
        const double sigma = gross ? 60 : options.noise_px;
        const Eigen::Vector2d noise(rng.Normal(), rng.Normal());
        const bool seen = projection.status == Status::kOk && geometry::InImage(rig.cameras[c].camera, projection.px);
        person.push_back({projection.px + sigma * noise, seen ? 0.9 : 0.0});
      }
      frame.people[c].push_back(person);
    }
    frames.push_back(frame);
  }
  return frames;
}

inline std::vector<KeypointJoint> JointsOf(const geometry::Rig& rig, const std::vector<triangulate::DetectedFrame>& frames) {
  return CollectKeypoints(rig, frames, {}, {});
}

/// Turns a camera about its own centre and moves it.
inline void Bump(const Eigen::Vector3d& turn_rad, const Eigen::Vector3d& move_m, geometry::RigCamera* camera) {
  const Eigen::Vector3d centre = camera->CenterInWorld() + move_m;
  camera->cam_from_world.rotation = (geometry::RotationExp(turn_rad) * camera->cam_from_world.rotation).normalized();
  camera->cam_from_world.translation = -(camera->cam_from_world.rotation * centre);
}

/// Every camera off by some degrees and tens of centimetres.
inline geometry::Rig Disturbed(const geometry::Rig& rig, double turn_rad, double move_m, uint64_t seed) {
  Rng rng(seed);
  geometry::Rig disturbed = rig;
  for (geometry::RigCamera& camera : disturbed.cameras) {
    const auto random = [&] { return Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal()); };
    const Eigen::Vector3d turn = turn_rad * random(), move = move_m * random();
    Bump(turn, move, &camera);
  }
  return disturbed;
}

}  // namespace mvstudio::calib::testing
