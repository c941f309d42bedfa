#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "avatar/body/body_template.h"

namespace mvstudio::body {

/// Pose by joint angles alone: no bone is stretched.
struct ArticulatedPose {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();  // metres; the root's head lies at rest head + shift in world
  std::vector<Eigen::Quaterniond>
      local_rotations;  // (B) about the bones' heads, relative to the parents, in axes of the rest pose
};

BodyPose ToBodyPose(const BodyTemplate& body, const ArticulatedPose& pose);

}  // namespace mvstudio::body
