#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "dataset/markers/marker_take.h"
#include "geometry/skeleton/skeleton.h"

/// A skeleton with fixed bone lengths and only rotations, as in BVH, fitted to joints.
namespace mvstudio::markers {

struct BvhNode {
  int joint = 0;    ///< of the skeleton
  int parent = -1;  ///< index into the nodes; parents come first
  std::vector<int> children;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  ///< metres, in the parent's axes at rest (y up)
};

struct BvhFrame {
  Eigen::Vector3d root = Eigen::Vector3d::Zero();  ///< metres, y up
  std::vector<Eigen::Quaterniond> local_rotation;  ///< by node: parent's axes from the node's
  bool held = false;                               ///< no root joint: the last position was kept
};

struct BvhMotion {
  std::vector<BvhNode> nodes;  ///< one per joint of the skeleton
  std::vector<BvhFrame> frames;
  double rms_m = 0, max_m = 0;  ///< distance of the animated joints from the given ones
  int num_joints = 0;           ///< joints compared
  int num_held = 0;             ///< frames that are held
};

/// Hierarchy: geometry::HierarchyOf, children in the skeleton's order. Lengths: the mean over the frames that show both ends,
/// else that of the skeleton's rest, else zero. Directions at rest: the skeleton's, else those of the frame that shows most
/// joints (the first of them). Where a joint has several children, their mean arrangement (generalised Procrustes, Gower 1975).
/// Each frame is fitted from the root down. Joints with several children get the rotation nearest to their arrangement
/// (Kabsch), with one child the smallest rotation that points the bone at the child. Where nothing is seen, rotations are kept.
/// Markers are joints by their names. Throws ContractViolation for a skeleton without joints.
BvhMotion FitBvh(const MarkerTake& take, const geometry::Skeleton& skeleton);

/// Markers and the skeleton that moves them.
struct MarkerBody {
  MarkerTake take;
  geometry::Skeleton skeleton;
};

/// People hang from their pelvis: a human skeleton that states no hierarchy gets MidHip as its root, and where it has none, one
/// in the mean of both hips. A neck is the mean of the shoulders where there is none. Other skeletons stay as they are.
MarkerBody HungFromPelvis(const MarkerTake& take, const geometry::Skeleton& skeleton);

/// Positions by the skeleton's joints, y up, metres.
std::vector<Eigen::Vector3d> BvhJoints(const BvhMotion& motion, const BvhFrame& frame);

/// Angles a, b, c (radians) with R = Rz(a) Rx(b) Ry(c); at b = ±90 degrees c is 0.
Eigen::Vector3d ZxyAngles(const Eigen::Matrix3d& rotation);

/// Biovision hierarchy: y up, centimetres, degrees, channels Zrotation Xrotation Yrotation. Blanks in names become "_".
std::string BvhText(const BvhMotion& motion, const geometry::Skeleton& skeleton, double rate_hz);

}  // namespace mvstudio::markers
