#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "avatar/body/articulated_pose.h"
#include "avatar/body/body_template.h"

namespace mvstudio::body {

/// The rotations of `pose`, its lengths left out; the root's head stays where it is.
ArticulatedPose FromBodyPose(const BodyTemplate& body, const BodyPose& pose);

/// A step: rotation vectors in world axes about the heads of the bones (3 B), each with all that hangs on it, then the shift
/// (3).
using PoseStep = Eigen::VectorXd;
ArticulatedPose Retract(const BodyTemplate& body, const ArticulatedPose& pose, const PoseStep& step);

/// Posed bones, ready for derivatives with respect to PoseStep.
class PosedBones {
 public:
  PosedBones(const BodyTemplate& body, const ArticulatedPose& pose);

  /// A rest point that follows bone `b`.
  Eigen::Vector3d At(int b, const Eigen::Vector3d& x_in_body) const { return pose_.bone_transforms[b] * x_in_body; }
  Eigen::Vector3d Vertex(int v) const;
  /// Blended rotation of a vertex: what its rest normal and offset are turned by.
  Eigen::Matrix3d VertexRotation(int v) const;

  /// Adds `weight` times the derivative of direction . x, for x that moves with bone `b`, to `gradient` (3 B + 3).
  void AddDerivative(int b, const Eigen::Vector3d& x_in_world, const Eigen::Vector3d& direction, double weight,
                     Eigen::VectorXd* gradient) const;
  /// The derivative of direction . vertex.
  Eigen::VectorXd VertexDerivative(int v, const Eigen::Vector3d& direction) const;

  const BodyPose& pose() const { return pose_; }
  Eigen::Matrix3d ParentRotation(int b) const;

 private:
  const BodyTemplate& body_;
  BodyPose pose_;
  Eigen::Matrix3Xd heads_;  // (3, B) in world
  std::vector<Eigen::Matrix3d> rotations_;
};

}  // namespace mvstudio::body
