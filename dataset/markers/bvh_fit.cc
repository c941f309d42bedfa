#include <algorithm>
#include <cmath>
#include <map>

#include "core/check.h"
#include "dataset/markers/bvh.h"
#include "geometry/rigid/decompositions.h"

namespace mvstudio::markers {
namespace {

/// The joints of one frame in the file's axes, y up; those that are missing are not valid.
struct Joints {
  std::vector<Eigen::Vector3d> x;
  std::vector<bool> valid;
};

std::vector<Joints> YUpJoints(const MarkerTake& take, const geometry::Skeleton& skeleton) {
  std::map<std::string, int> markers;
  for (int m = 0; m < take.num_markers(); ++m) markers[take.names[static_cast<size_t>(m)]] = m;
  std::vector<Joints> frames;
  for (int f = 0; f < take.num_frames(); ++f) {
    Joints& joints = frames.emplace_back();
    for (const std::string& name : skeleton.joints) {
      const auto marker = markers.find(name);
      const Eigen::Vector3d x =
          marker == markers.end() ? Eigen::Vector3d::Constant(std::nan("")) : take.x_in_world[take.Index(f, marker->second)];
      joints.valid.push_back(x.allFinite());
      joints.x.push_back(x.allFinite() ? Eigen::Vector3d(x.x(), x.z(), -x.y()) : Eigen::Vector3d::Zero());
    }
  }
  return frames;
}

/// Nodes from the root down, children in the skeleton's order.
std::vector<BvhNode> Hierarchy(const geometry::Skeleton& skeleton) {
  const std::vector<int> parents = HierarchyOf(skeleton);
  std::vector<std::vector<int>> children(parents.size());
  std::vector<std::pair<int, int>> open;  // joint, parent's node
  for (size_t j = 0; j < parents.size(); ++j) {
    if (parents[j] < 0) open.emplace_back(static_cast<int>(j), -1);
    if (parents[j] >= 0) children[static_cast<size_t>(parents[j])].push_back(static_cast<int>(j));
  }
  std::vector<BvhNode> nodes;
  while (!open.empty()) {
    const auto [joint, parent] = open.back();
    open.pop_back();
    const int index = static_cast<int>(nodes.size());
    if (parent >= 0) nodes[static_cast<size_t>(parent)].children.push_back(index);
    nodes.push_back({joint, parent, {}});
    const std::vector<int>& below = children[static_cast<size_t>(joint)];
    for (auto child = below.rbegin(); child != below.rend(); ++child) open.emplace_back(*child, index);
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

/// A node's joint and its parent's.
std::pair<size_t, size_t> Ends(const std::vector<BvhNode>& nodes, const BvhNode& node) {
  return {static_cast<size_t>(node.joint), static_cast<size_t>(nodes[static_cast<size_t>(node.parent)].joint)};
}

/// The frame with most joints.
const Joints& FullestFrame(const std::vector<Joints>& frames) {
  return *std::max_element(frames.begin(), frames.end(), [](const Joints& a, const Joints& b) {
    return std::count(a.valid.begin(), a.valid.end(), true) < std::count(b.valid.begin(), b.valid.end(), true);
  });
}

/// Where a node lies from its parent at rest, before lengths are measured.
Eigen::Vector3d RestOf(const std::vector<BvhNode>& nodes, const BvhNode& node, const geometry::Skeleton& skeleton,
                       const std::vector<Joints>& frames, const Joints& full) {
  const auto [joint, parent] = Ends(nodes, node);
  if (!skeleton.rest_m.empty()) return Eigen::Vector3d(skeleton.rest_m[joint].data());
  const auto shows = [joint = joint, parent = parent](const Joints& frame) {
    return frame.valid[joint] && frame.valid[parent];
  };
  if (shows(full)) return full.x[joint] - full.x[parent];
  for (const Joints& frame : frames) {
    if (shows(frame)) return frame.x[joint] - frame.x[parent];
  }
  return Eigen::Vector3d::Zero();
}

/// Offsets of the mean length over the frames that show both ends.
void SetLengths(const std::vector<Joints>& frames, const geometry::Skeleton& skeleton, std::vector<BvhNode>* nodes) {
  const Joints& full = FullestFrame(frames);
  for (BvhNode& node : *nodes) {
    if (node.parent < 0) continue;
    const auto [joint, parent] = Ends(*nodes, node);
    double sum = 0;
    int count = 0;
    for (const Joints& joints : frames) {
      if (joints.valid[joint] && joints.valid[parent]) sum += (joints.x[joint] - joints.x[parent]).norm(), ++count;
    }
    node.offset = RestOf(*nodes, node, skeleton, frames, full);
    if (count > 0 && node.offset.norm() > 0) node.offset *= sum / count / node.offset.norm();
  }
}

bool ShowsAllChildren(const std::vector<BvhNode>& nodes, const BvhNode& node, const Joints& joints) {
  return joints.valid[static_cast<size_t>(node.joint)] && std::all_of(node.children.begin(), node.children.end(), [&](int c) {
           return joints.valid[static_cast<size_t>(nodes[static_cast<size_t>(c)].joint)];
         });
}

/// The children's places about their joint, averaged over the frames after turning each to the arrangement so far.
bool AverageArrangement(const std::vector<Joints>& frames, const BvhNode& node, std::vector<BvhNode>* nodes) {
  std::vector<Eigen::Vector3d> sums(node.children.size(), Eigen::Vector3d::Zero());
  int count = 0;
  for (const Joints& joints : frames) {
    if (!ShowsAllChildren(*nodes, node, joints)) continue;
    std::vector<Eigen::Vector3d> from, to;
    for (const int child : node.children) {
      const BvhNode& below = (*nodes)[static_cast<size_t>(child)];
      from.push_back(below.offset);
      to.push_back(joints.x[static_cast<size_t>(below.joint)] - joints.x[static_cast<size_t>(node.joint)]);
    }
    const Eigen::Matrix3d turn = NearestTurn(from, to, Eigen::Matrix3d::Identity());
    for (size_t c = 0; c < to.size(); ++c) sums[c] += turn.transpose() * to[c];
    ++count;
  }
  if (count == 0) return false;
  for (size_t c = 0; c < sums.size(); ++c) (*nodes)[static_cast<size_t>(node.children[c])].offset = sums[c] / count;
  return true;
}

void SetArrangements(const std::vector<Joints>& frames, std::vector<BvhNode>* nodes) {
  constexpr int kRounds = 5;
  for (size_t i = 0; i < nodes->size(); ++i) {
    const BvhNode node = (*nodes)[i];
    if (node.children.size() < 2) continue;
    for (int round = 0; round < kRounds && AverageArrangement(frames, node, nodes); ++round) {
    }
  }
}

/// Axes and place of every node of a frame.
struct Placed {
  std::vector<Eigen::Matrix3d> axes;
  std::vector<Eigen::Vector3d> x;
};

/// The node's rotation in the world that brings its children nearest; `held` where none is seen.
Eigen::Matrix3d TurnOf(const std::vector<BvhNode>& nodes, const BvhNode& node, const Joints& joints, const Eigen::Vector3d& x,
                       const Eigen::Matrix3d& parent, const Eigen::Matrix3d& held) {
  std::vector<Eigen::Vector3d> from, to;
  for (const int child : node.children) {
    const BvhNode& below = nodes[static_cast<size_t>(child)];
    const Eigen::Vector3d aim = joints.x[static_cast<size_t>(below.joint)] - x;
    if (!joints.valid[static_cast<size_t>(below.joint)] || !(aim.norm() > 0) || !(below.offset.norm() > 0)) continue;
    from.push_back(below.offset), to.push_back(aim);
  }
  if (from.size() == 1) return Eigen::Quaterniond::FromTwoVectors(parent * from[0], to[0]).toRotationMatrix() * parent;
  return from.empty() ? held : NearestTurn(from, to, held);
}

/// The frame's rotations from the root down; what is not seen stays as it was in `last`.
BvhFrame Solve(const std::vector<BvhNode>& nodes, const Joints& joints, const BvhFrame& last) {
  BvhFrame frame = last;
  const size_t root = static_cast<size_t>(nodes[0].joint);
  frame.held = !joints.valid[root];
  if (frame.held) return frame;
  frame.root = joints.x[root];
  Placed placed{std::vector<Eigen::Matrix3d>(nodes.size()), std::vector<Eigen::Vector3d>(nodes.size())};
  for (size_t i = 0; i < nodes.size(); ++i) {
    const BvhNode& node = nodes[i];
    const size_t above = static_cast<size_t>(std::max(node.parent, 0));
    const Eigen::Matrix3d parent = node.parent < 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : placed.axes[above];
    placed.x[i] = node.parent < 0 ? frame.root : Eigen::Vector3d(placed.x[above] + parent * node.offset);
    const Eigen::Matrix3d held = parent * last.local_rotation[i].toRotationMatrix();
    const Eigen::Matrix3d turn = TurnOf(nodes, node, joints, placed.x[i], parent, held);
    frame.local_rotation[i] = Eigen::Quaterniond(parent.transpose() * turn).normalized();
    placed.axes[i] = parent * frame.local_rotation[i].toRotationMatrix();
  }
  return frame;
}

/// Before the first root is known, the skeleton stands where it will appear.
BvhFrame FirstFrame(const std::vector<BvhNode>& nodes, const std::vector<Joints>& frames) {
  BvhFrame first;
  first.local_rotation.assign(nodes.size(), Eigen::Quaterniond::Identity());
  for (const Joints& joints : frames) {
    if (!joints.valid[static_cast<size_t>(nodes[0].joint)]) continue;
    first.root = joints.x[static_cast<size_t>(nodes[0].joint)];
    break;
  }
  return first;
}

/// Adds the distances of one frame; `squares` is their sum.
void Compare(const Joints& joints, const BvhFrame& frame, double* squares, BvhMotion* motion) {
  const std::vector<Eigen::Vector3d> animated = BvhJoints(*motion, frame);
  for (size_t j = 0; j < animated.size(); ++j) {
    if (!joints.valid[j]) continue;
    const double error = (animated[j] - joints.x[j]).norm();
    *squares += error * error, ++motion->num_joints;
    motion->max_m = std::max(motion->max_m, error);
  }
}

/// A joint halfway between two that the skeleton has; nothing where it has the joint, or not both of them.
void AddMean(const std::string& name, const std::string& left, const std::string& right, MarkerBody* body) {
  const auto index = [body](const std::string& marker) {
    const auto& names = body->take.names;
    return static_cast<int>(std::find(names.begin(), names.end(), marker) - names.begin());
  };
  const int l = index(left), r = index(right), old = body->take.num_markers();
  if (body->skeleton.Find(name) >= 0 || std::max(l, r) >= old || body->skeleton.Find(left) < 0 ||
      body->skeleton.Find(right) < 0)
    return;
  MarkerTake to = body->take;
  to.names.push_back(name);
  to.x_in_world.clear(), to.sigma_m.clear(), to.source.clear();
  for (int f = 0; f < body->take.num_frames(); ++f) {
    const size_t first = body->take.Index(f, 0), a = body->take.Index(f, l), b = body->take.Index(f, r);
    const Eigen::Vector3d mean = (body->take.x_in_world[a] + body->take.x_in_world[b]) / 2;
    const auto copy = [first, old](const auto& from, auto* into) {
      into->insert(into->end(), from.begin() + static_cast<std::ptrdiff_t>(first),
                   from.begin() + static_cast<std::ptrdiff_t>(first) + old);
    };
    copy(body->take.x_in_world, &to.x_in_world), copy(body->take.sigma_m, &to.sigma_m), copy(body->take.source, &to.source);
    to.x_in_world.push_back(mean);
    to.sigma_m.push_back(0);
    to.source.push_back(mean.allFinite() ? Source::kFilled : Source::kMissing);
  }
  body->take = std::move(to);
  body->skeleton.joints.push_back(name);
}

/// Bones between shoulders and hips, and across, become a spine with shoulders and hips at its ends.
void ReplaceTrunk(geometry::Skeleton* skeleton) {
  const auto joint = [skeleton](const char* name) { return skeleton->Find(name); };
  const std::vector<int> corners = {joint("LShoulder"), joint("RShoulder"), joint("LHip"), joint("RHip")};
  const auto is_corner = [&](int j) { return std::find(corners.begin(), corners.end(), j) != corners.end(); };
  auto& bones = skeleton->bones;
  bones.erase(
      std::remove_if(bones.begin(), bones.end(), [&](const auto& b) { return is_corner(b.first) && is_corner(b.second); }),
      bones.end());
  const int pelvis = joint("MidHip"), neck = joint("Neck");
  for (const char* hip : {"LHip", "RHip"}) bones.emplace_back(pelvis, joint(hip));
  bones.emplace_back(pelvis, neck);
  for (const char* end : {"LShoulder", "RShoulder", "Nose"}) {
    const int j = joint(end);
    const auto joins = [&](const auto& b) { return std::minmax(b.first, b.second) == std::minmax(j, neck); };
    if (j >= 0 && std::none_of(bones.begin(), bones.end(), joins)) bones.emplace_back(neck, j);
  }
}

}  // namespace

std::vector<Eigen::Vector3d> BvhJoints(const BvhMotion& motion, const BvhFrame& frame) {
  const size_t count = motion.nodes.size();
  std::vector<Eigen::Vector3d> by_joint(count), place(count);
  std::vector<Eigen::Matrix3d> axes(count);
  for (size_t i = 0; i < count; ++i) {
    const BvhNode& node = motion.nodes[i];
    const size_t above = static_cast<size_t>(std::max(node.parent, 0));
    const Eigen::Matrix3d parent = node.parent < 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : axes[above];
    place[i] = node.parent < 0 ? frame.root : Eigen::Vector3d(place[above] + parent * node.offset);
    axes[i] = parent * frame.local_rotation[i].toRotationMatrix();
    by_joint[static_cast<size_t>(node.joint)] = place[i];
  }
  return by_joint;
}

MarkerBody HungFromPelvis(const MarkerTake& take, const geometry::Skeleton& skeleton) {
  MarkerBody hung{take, skeleton};
  geometry::Skeleton& to = hung.skeleton;
  if (!to.human || !to.parents.empty()) return hung;
  AddMean("MidHip", "LHip", "RHip", &hung);
  AddMean("Neck", "LShoulder", "RShoulder", &hung);
  const int pelvis = to.Find("MidHip");
  if (pelvis < 0) return hung;
  if (skeleton.Find("MidHip") < 0 && to.Find("Neck") >= 0) ReplaceTrunk(&to);
  to.parents = SpanningTree(to, pelvis);
  to.lengths.clear(), to.colours.clear();
  return hung;
}

BvhMotion FitBvh(const MarkerTake& take, const geometry::Skeleton& skeleton) {
  MVS_CHECK(!skeleton.joints.empty(), "a skeleton without joints");
  const std::vector<Joints> frames = YUpJoints(take, skeleton);
  BvhMotion motion;
  motion.nodes = Hierarchy(skeleton);
  if (frames.empty()) return motion;
  SetLengths(frames, skeleton, &motion.nodes);
  SetArrangements(frames, &motion.nodes);
  BvhFrame last = FirstFrame(motion.nodes, frames);
  double squares = 0;
  for (const Joints& joints : frames) {
    last = Solve(motion.nodes, joints, last);
    motion.num_held += last.held;
    Compare(joints, last, &squares, &motion);
    motion.frames.push_back(last);
  }
  motion.rms_m = std::sqrt(squares / std::max(motion.num_joints, 1));
  return motion;
}

}  // namespace mvstudio::markers
