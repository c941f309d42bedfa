#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "dataset/pose/pose3d.h"

/// A skeleton with fixed bone lengths and only rotations, as in BVH, fitted to joints.
namespace mvstudio::exports {

struct BvhNode {
  int joint = 0;    ///< of Panoptic's 19
  int parent = -1;  ///< index into the nodes; parents come first
  std::vector<int> children;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  ///< metres, in the parent's axes at rest (y up, the person faces z)
};

struct BvhFrame {
  Eigen::Vector3d root = Eigen::Vector3d::Zero();     ///< metres, y up
  std::array<Eigen::Quaterniond, 19> local_rotation;  ///< by node: parent's axes from the node's
  bool held = false;                                  ///< no root joint: the last position was kept
};

struct BvhMotion {
  std::array<BvhNode, 19> nodes;
  std::vector<BvhFrame> frames;
  double rms_m = 0, max_m = 0;  ///< distance of the animated joints from the given ones
  int num_joints = 0;           ///< joints compared
};

/// Hierarchy from BodyCenter. Rest offsets: mean bone lengths along the directions of a T-pose; where a joint has several
/// children, their mean arrangement (generalised Procrustes). Each frame is fitted from the root down. Joints with several
/// children get the rotation nearest to their arrangement (Kabsch), with one child the smallest rotation that points the
/// bone at the child. `poses` may contain null (nobody) and missing joints: rotations are then kept. Joints are in world,
/// z up.
BvhMotion FitBvh(const std::vector<const dataset::Coco19Pose*>& poses);

/// Positions of the joints, by Panoptic's index, y up, metres.
std::array<Eigen::Vector3d, 19> BvhJoints(const BvhMotion& motion, const BvhFrame& frame);

/// Angles a, b, c (radians) with R = Rz(a) Rx(b) Ry(c); at b = ±90 degrees c is 0.
Eigen::Vector3d ZxyAngles(const Eigen::Matrix3d& rotation);

}  // namespace mvstudio::exports
