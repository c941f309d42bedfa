#include <algorithm>
#include <cmath>

#include "exports/bvh.h"
#include "exports/joint_files.h"
#include "geometry/rigid/decompositions.h"

namespace mvstudio::exports {
namespace {

struct Bone {
  int joint, parent;  ///< of Panoptic's 19
  double x, y, z;     ///< direction at rest: x to the person's left, y up, z forward
  double length_m;    ///< where no frame shows it
};
// Order: parents first.
constexpr Bone kBones[] = {{2, -1, 0, 0, 0, 0},
                           {0, 2, 0, 1, 0, 0.50},
                           {1, 0, 0, 0.8, 0.6, 0.20},
                           {15, 1, 0.6, 0.6, -0.5, 0.05},
                           {16, 15, 0.4, -0.1, -0.9, 0.10},
                           {17, 1, -0.6, 0.6, -0.5, 0.05},
                           {18, 17, -0.4, -0.1, -0.9, 0.10},
                           {3, 0, 1, 0, 0, 0.18},
                           {4, 3, 1, 0, 0, 0.28},
                           {5, 4, 1, 0, 0, 0.25},
                           {9, 0, -1, 0, 0, 0.18},
                           {10, 9, -1, 0, 0, 0.28},
                           {11, 10, -1, 0, 0, 0.25},
                           {6, 2, 1, 0, 0, 0.10},
                           {7, 6, 0, -1, 0, 0.42},
                           {8, 7, 0, -1, 0, 0.42},
                           {12, 2, -1, 0, 0, 0.10},
                           {13, 12, 0, -1, 0, 0.42},
                           {14, 13, 0, -1, 0, 0.42}};

/// The joints of one frame in the file's axes.
struct Joints {
  std::array<Eigen::Vector3d, 19> x;
  std::array<bool, 19> valid{};
};

Joints YUpJoints(const dataset::Coco19Pose* pose) {
  Joints joints;
  for (int j = 0; j < 19; ++j) {
    joints.valid[j] = pose && pose->valid[j];
    joints.x[j] = joints.valid[j] ? YUp(pose->x_in_world.col(j)) : Eigen::Vector3d::Zero();
  }
  return joints;
}

std::array<BvhNode, 19> Hierarchy() {
  std::array<BvhNode, 19> nodes;
  for (int i = 0; i < 19; ++i) {
    nodes[i].joint = kBones[i].joint;
    for (int p = 0; p < i; ++p) {
      if (kBones[p].joint == kBones[i].parent) nodes[i].parent = p;
    }
    if (nodes[i].parent >= 0) nodes[nodes[i].parent].children.push_back(i);
  }
  return nodes;
}

/// Rotation that brings `from` nearest to `to` (Kabsch); `prior` decides what they leave open.
Eigen::Matrix3d NearestTurn(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to,
                            const Eigen::Matrix3d& prior) {
  constexpr double kPriorWeight = 1e-9;
  double scale = 0;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < from.size(); ++i) sum += to[i] * from[i].transpose(), scale += from[i].squaredNorm();
  sum += kPriorWeight * scale * prior;
  return geometry::ProcrustesRotation(sum);
}

/// Mean length over the frames that show both ends.
void SetLengths(const std::vector<Joints>& frames, std::array<BvhNode, 19>* nodes) {
  for (int i = 1; i < 19; ++i) {
    BvhNode& node = (*nodes)[i];
    const int parent = (*nodes)[node.parent].joint;
    double sum = 0;
    int count = 0;
    for (const Joints& joints : frames) {
      if (joints.valid[node.joint] && joints.valid[parent]) sum += (joints.x[node.joint] - joints.x[parent]).norm(), ++count;
    }
    const double length = count > 0 ? sum / count : kBones[i].length_m;
    node.offset = length * Eigen::Vector3d(kBones[i].x, kBones[i].y, kBones[i].z).normalized();
  }
}

/// Children of `node` whose place relative to it is known in a frame.
std::vector<int> SeenChildren(const std::array<BvhNode, 19>& nodes, const BvhNode& node, const Joints& joints) {
  std::vector<int> seen;
  for (const int child : node.children) {
    if (joints.valid[nodes[child].joint] && joints.valid[node.joint]) seen.push_back(child);
  }
  return seen;
}

/// Generalised Procrustes (Gower 1975) of the children's arrangement about each joint that has several.
void SetArrangements(const std::vector<Joints>& frames, std::array<BvhNode, 19>* nodes) {
  constexpr int kRounds = 5;
  for (BvhNode& node : *nodes) {
    if (node.children.size() < 2) continue;
    for (int round = 0; round < kRounds; ++round) {
      std::vector<Eigen::Vector3d> sums(node.children.size(), Eigen::Vector3d::Zero());
      int count = 0;
      for (const Joints& joints : frames) {
        if (SeenChildren(*nodes, node, joints).size() != node.children.size()) continue;
        std::vector<Eigen::Vector3d> from, to;
        for (const int child : node.children) {
          from.push_back((*nodes)[child].offset);
          to.push_back(joints.x[(*nodes)[child].joint] - joints.x[node.joint]);
        }
        const Eigen::Matrix3d turn = NearestTurn(from, to, Eigen::Matrix3d::Identity());
        for (size_t c = 0; c < to.size(); ++c) sums[c] += turn.transpose() * to[c];
        ++count;
      }
      if (count == 0) break;
      for (size_t c = 0; c < sums.size(); ++c) (*nodes)[node.children[c]].offset = sums[c] / count;
    }
  }
}

/// The frame's rotations from the root down; what is not seen stays as it was in `last`.
BvhFrame Solve(const std::array<BvhNode, 19>& nodes, const Joints& joints, const BvhFrame& last) {
  BvhFrame frame = last;
  frame.held = !joints.valid[nodes[0].joint];
  if (!frame.held) frame.root = joints.x[nodes[0].joint];
  std::array<Eigen::Matrix3d, 19> global;
  std::array<Eigen::Vector3d, 19> place;
  for (int i = 0; i < 19; ++i) {
    const BvhNode& node = nodes[i];
    const Eigen::Matrix3d parent = node.parent < 0 ? Eigen::Matrix3d::Identity() : global[node.parent];
    place[i] = node.parent < 0 ? frame.root : place[node.parent] + parent * node.offset;
    std::vector<Eigen::Vector3d> from, to;
    for (const int child : node.children) {
      const Eigen::Vector3d aim = joints.x[nodes[child].joint] - place[i];
      if (frame.held || !joints.valid[nodes[child].joint] || !(aim.norm() > 0)) continue;
      from.push_back(nodes[child].offset), to.push_back(aim);
    }
    const Eigen::Matrix3d held = parent * last.local_rotation[i].toRotationMatrix();
    global[i] = held;
    if (from.size() == 1) {
      global[i] = Eigen::Quaterniond::FromTwoVectors(parent * from[0], to[0]).toRotationMatrix() * parent;
    } else if (from.size() > 1) {
      global[i] = NearestTurn(from, to, held);
    }
    frame.local_rotation[i] = Eigen::Quaterniond(parent.transpose() * global[i]).normalized();
    global[i] = parent * frame.local_rotation[i].toRotationMatrix();
  }
  return frame;
}

}  // namespace

std::array<Eigen::Vector3d, 19> BvhJoints(const BvhMotion& motion, const BvhFrame& frame) {
  std::array<Eigen::Vector3d, 19> by_joint, place;
  std::array<Eigen::Matrix3d, 19> global;
  for (int i = 0; i < 19; ++i) {
    const BvhNode& node = motion.nodes[i];
    const Eigen::Matrix3d parent = node.parent < 0 ? Eigen::Matrix3d::Identity() : global[node.parent];
    place[i] = node.parent < 0 ? frame.root : place[node.parent] + parent * node.offset;
    global[i] = parent * frame.local_rotation[i].toRotationMatrix();
    by_joint[node.joint] = place[i];
  }
  return by_joint;
}

Eigen::Vector3d ZxyAngles(const Eigen::Matrix3d& r) {
  const double cos_b = std::hypot(r(2, 0), r(2, 2));
  const double b = std::atan2(r(2, 1), cos_b);
  constexpr double kLocked = 1e-12;
  if (cos_b < kLocked) return {std::atan2(r(1, 0), r(0, 0)), b, 0};
  return {std::atan2(-r(0, 1), r(1, 1)), b, std::atan2(-r(2, 0), r(2, 2))};
}

BvhMotion FitBvh(const std::vector<const dataset::Coco19Pose*>& poses) {
  std::vector<Joints> frames;
  for (const dataset::Coco19Pose* pose : poses) frames.push_back(YUpJoints(pose));
  BvhMotion motion;
  motion.nodes = Hierarchy();
  SetLengths(frames, &motion.nodes);
  SetArrangements(frames, &motion.nodes);
  BvhFrame last;
  last.local_rotation.fill(Eigen::Quaterniond::Identity());
  for (const Joints& joints : frames) {  // before the first root is known, the person stands where it will appear
    if (joints.valid[motion.nodes[0].joint]) {
      last.root = joints.x[motion.nodes[0].joint];
      break;
    }
  }
  double sum = 0;
  for (const Joints& joints : frames) {
    last = Solve(motion.nodes, joints, last);
    motion.frames.push_back(last);
    const auto animated = BvhJoints(motion, last);
    for (int j = 0; j < 19; ++j) {
      if (!joints.valid[j]) continue;
      const double error = (animated[j] - joints.x[j]).norm();
      sum += error * error, ++motion.num_joints;
      motion.max_m = std::max(motion.max_m, error);
    }
  }
  motion.rms_m = std::sqrt(sum / std::max(motion.num_joints, 1));
  return motion;
}

}  // namespace mvstudio::exports
