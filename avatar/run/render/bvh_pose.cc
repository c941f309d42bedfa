#include "avatar/run/render/bvh_pose.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <cmath>

#include "core/error.h"
#include "core/statistics.h"
#include "geometry/rigid/rigid3.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::avatar {
namespace {

using dataset::Coco19Pose;

constexpr int kHeadJoints[] = {1, 15, 16, 17, 18};
constexpr int kNeck = 0, kCenter = 2, kLeftShoulder = 3, kRightShoulder = 9, kLeftHip = 6, kRightHip = 12;
constexpr int kNeeded[] = {3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14};

/// "LeftForeArm" -> left, fore, arm; "mixamorig:LHip" -> l, hip; "upper_arm.L" -> upper, arm, l.
std::vector<std::string> WordsOf(const std::string& full_name) {
  const std::string name = full_name.substr(full_name.rfind(':') + 1);
  std::vector<std::string> words;
  bool fresh = true;
  for (size_t i = 0; i < name.size(); ++i) {
    const auto is = [&](size_t k, int (*test)(int)) { return k < name.size() && test(static_cast<unsigned char>(name[k])); };
    if (!is(i, std::isalnum)) {
      fresh = true;
      continue;
    }
    const bool upper = is(i, std::isupper) && i > 0;
    if (upper && (is(i - 1, std::islower) || is(i + 1, std::islower))) fresh = true;
    if (fresh) words.emplace_back();
    words.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(name[i])));
    fresh = false;
  }
  return words;
}

/// Side ('l', 'r', 0) and the rest of the name in one word.
std::pair<char, std::string> SideAndPart(const std::string& name) {
  char side = 0;
  std::string part;
  for (const std::string& word : WordsOf(name)) {
    if (side == 0 && (word == "l" || word == "left" || word == "r" || word == "right"))
      side = word[0];
    else
      part += word;
  }
  for (const std::string prefix : {"left", "right"}) {  // "leftarm"
    if (side == 0 && part.rfind(prefix, 0) == 0 && part.size() > prefix.size()) side = prefix[0], part.erase(0, prefix.size());
  }
  return {side, part};
}

/// Names of a joint, the best first.
struct Names {
  int left, right;  // the same for joints in the middle
  std::vector<std::string> parts;
};
const std::vector<Names>& KnownNames() {
  static const std::vector<Names> names = {{0, 0, {"neck", "neck1"}},
                                           {1, 1, {"nose"}},
                                           {2, 2, {"midhip", "bodycenter"}},
                                           {3, 9, {"upperarm", "arm", "uparm", "humerus", "shoulder", "shldr"}},
                                           {4, 10, {"forearm", "elbow", "lowerarm", "lowarm", "radius"}},
                                           {5, 11, {"wrist", "hand"}},
                                           {6, 12, {"upleg", "upperleg", "thigh", "femur", "hip"}},
                                           {7, 13, {"knee", "leg", "lowerleg", "lowleg", "shin", "calf", "tibia"}},
                                           {8, 14, {"ankle", "foot"}},
                                           {15, 17, {"eye"}},
                                           {16, 18, {"ear"}}};
  return names;
}

int FindPart(const BvhClip& clip, char side, const std::vector<std::string>& parts) {
  for (const std::string& part : parts) {
    for (size_t j = 0; j < clip.joints.size(); ++j) {
      if (SideAndPart(clip.joints[j].name) == std::make_pair(side, part)) return static_cast<int>(j);
    }
  }
  return -1;
}

/// Axes of the trunk as columns: to the person's left, up along the spine, forward.
Eigen::Matrix3d TrunkAxes(const Coco19Pose& pose) {
  const auto& x = pose.x_in_world;
  const Eigen::Vector3d up = (x.col(kNeck) - x.col(kCenter)).normalized();
  const Eigen::Vector3d across = x.col(kLeftShoulder) - x.col(kRightShoulder) + x.col(kLeftHip) - x.col(kRightHip);
  const Eigen::Vector3d left = (across - up * up.dot(across)).normalized();
  Eigen::Matrix3d axes;
  axes << left, up, left.cross(up);
  return axes;
}

/// Axes of the head: to the left along the ears, forward towards the nose.
Eigen::Matrix3d HeadAxes(const Coco19Pose& pose) {
  const auto& x = pose.x_in_world;
  const Eigen::Vector3d left = (x.col(16) - x.col(18)).normalized();
  const Eigen::Vector3d ahead = x.col(1) - (x.col(16) + x.col(18)) / 2;
  const Eigen::Vector3d forward = (ahead - left * left.dot(ahead)).normalized();
  Eigen::Matrix3d axes;
  axes << left, forward.cross(left), forward;
  return axes;
}

bool AllValid(const Coco19Pose& pose, std::initializer_list<int> joints) {
  return std::all_of(joints.begin(), joints.end(), [&](int j) { return pose.valid[j]; });
}

/// The 19 joints of a placement, in the file's axes; joints of the head only where the file has them.
Coco19Pose JointsAt(const BvhPlacement& at, const std::array<int, 19>& match) {
  Coco19Pose pose;
  for (int j = 0; j < 19; ++j) {
    pose.valid[j] = match[j] >= 0, pose.confidence[j] = match[j] >= 0 ? 1 : 0;
    if (match[j] >= 0) pose.x_in_world.col(j) = at.place[match[j]];
  }
  const auto middle = [&](int j, int left, int right) {
    if (pose.valid[j]) return;
    pose.x_in_world.col(j) = (pose.x_in_world.col(left) + pose.x_in_world.col(right)) / 2;
    pose.valid[j] = true, pose.confidence[j] = 1;
  };
  middle(kNeck, kLeftShoulder, kRightShoulder);
  middle(kCenter, kLeftHip, kRightHip);
  return pose;
}

/// Which of the file's axes points up: 1 (y) or 2 (z).
int UpAxis(const BvhClip& clip, const std::array<int, 19>& match) {
  constexpr int kLooks = 16;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = 0; k < kLooks; ++k) {
    const Coco19Pose pose = JointsAt(PlaceJoints(clip, k * (clip.num_frames - 1) / (kLooks - 1)), match);
    sum += (pose.x_in_world.col(kNeck) - pose.x_in_world.col(kCenter)).normalized();
  }
  return sum[2] > sum[1] ? 2 : 1;
}

/// Adds the joints of the head that the file lacks.
void AddHead(const HeadShape& head, const Eigen::Matrix3d& head_axes, double trunk_units, Coco19Pose* pose) {
  for (int k = 0; k < 5; ++k) {
    const int j = kHeadJoints[k];
    if (pose->valid[j]) continue;
    pose->x_in_world.col(j) = pose->x_in_world.col(kNeck) + head_axes * head.offset_m[k] * (trunk_units / head.trunk_m);
    pose->valid[j] = true, pose->confidence[j] = 1;
  }
}

void RequireJoints(const std::array<int, 19>& match, const std::string& path) {
  std::string missing;
  for (const int j : kNeeded) {
    if (match[j] < 0) missing += (missing.empty() ? "" : ", ") + geometry::Coco19().joints[j];
  }
  if (missing.empty()) return;
  throw FormatError(path, "HIERARCHY",
                    "has no joint that could be " + missing +
                        "; known names are like LeftArm, LeftForeArm, LeftHand, LeftUpLeg, LeftLeg, LeftFoot");
}

}  // namespace

HeadShape MeasureHead(const std::vector<Coco19Pose>& poses) {
  HeadShape head;
  head.offset_m = {
      Eigen::Vector3d(0, 0.14, 0.13), {0.03, 0.17, 0.11}, {0.08, 0.16, 0.03}, {-0.03, 0.17, 0.11}, {-0.08, 0.16, 0.03}};
  std::array<std::array<std::vector<double>, 3>, 5> offsets;
  std::vector<double> trunks;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const Coco19Pose& pose : poses) {
    if (!AllValid(pose, {0, 1, 2, 3, 6, 9, 12, 15, 16, 17, 18})) continue;
    const Eigen::Matrix3d trunk = TrunkAxes(pose), axes = HeadAxes(pose);
    if (!trunk.allFinite() || !axes.allFinite()) continue;
    sum += trunk.transpose() * axes;
    trunks.push_back((pose.x_in_world.col(kNeck) - pose.x_in_world.col(kCenter)).norm());
    for (int k = 0; k < 5; ++k) {
      const Eigen::Vector3d offset = axes.transpose() * (pose.x_in_world.col(kHeadJoints[k]) - pose.x_in_world.col(kNeck));
      for (int c = 0; c < 3; ++c) offsets[k][c].push_back(offset[c]);
    }
  }
  if (trunks.empty() || !(sum.determinant() > 0)) return head;
  const Eigen::Quaterniond trunk_from_head = geometry::NearestRotation(sum);
  head.trunk_m = UpperMedian(trunks);
  for (int k = 0; k < 5; ++k) {
    head.offset_m[k] =
        trunk_from_head * Eigen::Vector3d(UpperMedian(offsets[k][0]), UpperMedian(offsets[k][1]), UpperMedian(offsets[k][2]));
  }
  return head;
}

std::array<int, 19> MatchJoints(const BvhClip& clip) {
  std::array<int, 19> match;
  match.fill(-1);
  for (const Names& names : KnownNames()) {
    const bool middle = names.left == names.right;
    match[names.left] = FindPart(clip, middle ? 0 : 'l', names.parts);
    if (!middle) match[names.right] = FindPart(clip, 'r', names.parts);
  }
  return match;
}

PoseTrack PosesFromBvh(const BvhClip& clip, const HeadShape& head, const std::string& path) {
  const std::array<int, 19> match = MatchJoints(clip);
  RequireJoints(match, path);
  const int named = FindPart(clip, 0, {"head"}), head_joint = named >= 0 ? named : match[kNeck];
  const Coco19Pose rest = JointsAt(PlaceJoints(clip, -1), match);
  const Eigen::Matrix3d rest_axes = TrunkAxes(rest);
  const double trunk_units = (rest.x_in_world.col(kNeck) - rest.x_in_world.col(kCenter)).norm();
  if (!(trunk_units > 0) || !rest_axes.allFinite())
    throw FormatError(path, "HIERARCHY", "neck and hips are in one place at rest");
  const bool y_up = UpAxis(clip, match) == 1;
  PoseTrack track;
  track.source = path;
  track.rate_hz = 1 / clip.frame_time_s;
  for (int f = 0; f < clip.num_frames; ++f) {
    const BvhPlacement at = PlaceJoints(clip, f);
    Coco19Pose pose = JointsAt(at, match);
    AddHead(head, head_joint >= 0 ? Eigen::Matrix3d(at.rotation[head_joint] * rest_axes) : TrunkAxes(pose), trunk_units, &pose);
    if (y_up) {
      const Eigen::Matrix<double, 3, 19> x = pose.x_in_world;
      pose.x_in_world << x.row(0), -x.row(2), x.row(1);
    }
    track.frames.push_back(f);
    track.poses.push_back(pose);
  }
  return track;
}

}  // namespace mvstudio::avatar
