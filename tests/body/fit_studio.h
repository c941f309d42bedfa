#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "avatar/body/fit/fit_body.h"
#include "avatar/body/fit/rim.h"
#include "avatar/body/surface_nets.h"
#include "core/random.h"

namespace mvstudio::body::testing {

/// Looks at a person of `height_m` from 3 m away, `angle_rad` about the vertical.
inline geometry::RigCamera CameraAt(double angle_rad, double camera_height_m, int size_px = 200) {
  using Eigen::Vector3d;
  const Vector3d target(0, 0, 0.9), place(3 * std::sin(angle_rad), -3 * std::cos(angle_rad), camera_height_m);
  const Vector3d forward = (target - place).normalized(), right = forward.cross(Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d axes;
  axes << right.transpose(), forward.cross(right).transpose(), forward.transpose();
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("cam", size_px, size_px, 1.2 * size_px);
  camera.cam_from_world.rotation = geometry::NearestRotation(axes);
  camera.cam_from_world.translation = -(axes * place);
  return camera;
}

struct StudioOptions {
  int num_steps = 20, num_cameras = 5;
  double height_m = 1.82;
  double spread_rad = 0.15;  ///< of the bones' rotations; 0: a person who stands still
  bool skirt = false;
};

/// Silhouettes and joints of a person who is not the mannequin: another height, a belly, thick legs.
struct Studio {
  static constexpr int kSizePx = 200;
  BodyTemplate rest = MakeMannequin(1.75, 0.5);
  BodyTemplate person;
  std::vector<FitStep> steps;
  std::vector<ArticulatedPose> poses;

  explicit Studio(int num_steps, int num_cameras = 5) : Studio(StudioOptions{num_steps, num_cameras}) {}
  explicit Studio(const StudioOptions& options) : person(MakeMannequin(options.height_m, 0.5)) {
    const Eigen::Matrix3Xf normals = VertexNormals(person.vertices, person.faces);
    for (Eigen::Index v = 0; v < person.vertices.cols(); ++v) {
      const double z = person.vertices(2, v) / options.height_m;
      const double belly = 0.035 * std::exp(-std::pow((z - 0.6) / 0.08, 2)), leg = z < 0.45 ? 0.012 : 0;
      person.vertices.col(v) += static_cast<float>(belly + leg) * normals.col(v);
    }
    Rng rng(11);
    for (int i = 0; i < options.num_steps; ++i) AddStep(i, RandomPose(options.spread_rad, rng), options);
  }

 private:
  ArticulatedPose RandomPose(double spread_rad, Rng& rng) const {
    ArticulatedPose pose;
    for (size_t b = 0; b < person.bone_names.size(); ++b) {
      const bool stiff = b > 0 && person.bone_names[b].find("hand") != std::string::npos;
      const double spread = stiff ? std::min(spread_rad, 0.02) : spread_rad;
      pose.local_rotations.push_back(geometry::RotationExp(spread * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal())));
    }
    return pose;
  }

  void AddStep(int i, const ArticulatedPose& pose, const StudioOptions& options) {
    FitStep step;
    step.frame = i;
    step.joints.x_in_world = PosedCoco19(person, ToBodyPose(person, pose)), step.joints.valid.fill(true);
    const Eigen::Matrix3Xf vertices = SkinVertices(person, ToBodyPose(person, pose));
    for (int c = 0; c < options.num_cameras; ++c) {
      const geometry::RigCamera camera = CameraAt(2 * M_PI * c / options.num_cameras, c % 2 ? 1.8 : 0.8, kSizePx);
      Image cover = RasterizeCover(person.faces, vertices, camera);
      if (options.skirt) AddSkirt(pose, camera, options.height_m, &cover);
      const bool held_out = options.num_steps >= 10 && i % 5 == 2;
      step.views.push_back(
          {"cam" + std::to_string(c), camera, std::make_shared<MaskOutline>(std::move(cover)), nullptr, held_out});
    }
    steps.push_back(step);
    poses.push_back(pose);
  }

  /// A cone that hangs from the pelvis to the knees.
  void AddSkirt(const ArticulatedPose& pose, const geometry::RigCamera& camera, double height_m, Image* cover) const {
    constexpr int kSides = 24;
    Eigen::Matrix3Xf cone(3, 2 * kSides);
    Eigen::Matrix3Xi faces(3, 2 * kSides);
    const geometry::Rigid3 pelvis = ToBodyPose(person, pose).bone_transforms[0];
    for (int k = 0; k < kSides; ++k) {
      const double angle = 2 * M_PI * k / kSides;
      const Eigen::Vector3d out(std::cos(angle), std::sin(angle), 0);
      const Eigen::Vector3d waist = 0.09 * height_m * out + 0.58 * height_m * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d hem = 0.2 * height_m * out + 0.3 * height_m * Eigen::Vector3d::UnitZ();
      cone.col(k) = (pelvis * waist).cast<float>(), cone.col(kSides + k) = (pelvis * hem).cast<float>();
      const int next = (k + 1) % kSides;
      faces.col(2 * k) << k, kSides + k, next, faces.col(2 * k + 1) << next, kSides + k, kSides + next;
    }
    const Image skirt = RasterizeCover(faces, cone, camera);
    for (size_t p = 0; p < cover->pixels.size(); ++p) cover->pixels[p] = std::max(cover->pixels[p], skirt.pixels[p]);
  }
};

}  // namespace mvstudio::body::testing

namespace mvstudio::body {
using namespace testing;
}
