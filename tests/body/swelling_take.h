#pragma once

#include <cmath>
#include <memory>
#include <string>

#include "avatar/body/dynamic/take_outlines.h"
#include "tests/body/fit_studio.h"

namespace mvstudio::body::testing {

inline const BodyTemplate& Small() {
  static const BodyTemplate body = MakeMannequin(1.75, 0.4);
  return body;
}

inline int BoneWithRole(BoneRole role) {
  for (size_t b = 0; b < Small().bone_roles.size(); ++b) {
    if (Small().bone_roles[b] == role) return static_cast<int>(b);
  }
  return -1;
}

/// Both legs swing, by different periods.
inline ArticulatedPose SwingingPose(int i) {
  ArticulatedPose pose;
  pose.local_rotations.assign(Small().bone_names.size(), Eigen::Quaterniond::Identity());
  pose.local_rotations[BoneWithRole(BoneRole::kLeftThigh)] = geometry::RotationExp({0.4 * std::sin(0.7 * i), 0, 0});
  pose.local_rotations[BoneWithRole(BoneRole::kRightThigh)] = geometry::RotationExp({-0.4 * std::sin(0.7 * i + 0.5), 0, 0});
  return pose;
}

/// The belly moves forwards as the left leg does, `per_radian_m`.
inline Eigen::Matrix3Xf Swell(const ArticulatedPose& pose, double per_radian_m) {
  const double turn = geometry::RotationLog(pose.local_rotations[BoneWithRole(BoneRole::kLeftThigh)])[0];
  Eigen::Matrix3Xf offsets = Eigen::Matrix3Xf::Zero(3, Small().vertices.cols());
  for (Eigen::Index v = 0; v < offsets.cols(); ++v) {
    const double z = Small().vertices(2, v), share = std::exp(-std::pow((z - 1.0) / 0.15, 2));
    offsets(1, v) = static_cast<float>(turn * per_radian_m * share);
  }
  return offsets;
}

/// Silhouettes of a body that swells so, seen by three cameras.
struct SwellingTake {
  std::vector<FitStep> steps;
  PersonBody person{Small(), 0.003, {}, {}};

  SwellingTake(int count, double per_radian_m) {
    for (int i = 0; i < count; ++i) AddStep(i, per_radian_m);
  }

 private:
  void AddStep(int i, double per_radian_m) {
    const ArticulatedPose pose = SwingingPose(i);
    const BodyPose posed = ToBodyPose(Small(), pose);
    FitStep step;
    step.frame = 10 + i;
    step.joints.x_in_world = PosedCoco19(Small(), posed), step.joints.valid.fill(true);
    const Eigen::Matrix3Xf vertices = SkinVertices(WithOffsets(Small(), Swell(pose, per_radian_m)), posed);
    for (int c = 0; c < 3; ++c) {
      const geometry::RigCamera camera = CameraAt(2 * M_PI * c / 3 + 0.5, 1.2, 160);
      step.views.push_back({"cam" + std::to_string(c), camera,
                            std::make_shared<MaskOutline>(RasterizeCover(Small().faces, vertices, camera)), nullptr, false});
    }
    steps.push_back(step);
    person.seen[step.frame] = pose;
  }
};

}  // namespace mvstudio::body::testing
