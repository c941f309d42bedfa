#include "synth/motion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "avatar/body/role_bones.h"
#include "core/check.h"
#include "core/random.h"
#include "core/units.h"

namespace mvstudio::synth {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

/// Smooth pseudo-random signals in [-1, 1], one a channel.
class Signals {
 public:
  explicit Signals(uint64_t seed) : seed_(seed) {}
  double operator()(int channel, double time_s) const {
    static constexpr double kFrequencies[] = {0.173, 0.319, 0.547};  // Hz
    static constexpr double kAmplitudes[] = {0.42, 0.36, 0.22};
    Rng rng(seed_ * 7919 + static_cast<uint64_t>(channel) * 104729 + 3);
    double sum = 0;
    for (int i = 0; i < 3; ++i) {
      const double frequency = kFrequencies[i] * rng.Uniform(0.85, 1.15), phase = rng.Uniform(0, 2 * kPi);
      sum += kAmplitudes[i] * std::sin(2 * kPi * frequency * time_s + phase);
    }
    return sum;
  }

 private:
  uint64_t seed_;
};

Quaterniond Turn(double angle, const Vector3d& axis) { return Quaterniond(Eigen::AngleAxisd(angle, axis)); }
Quaterniond TurnX(double angle) { return Turn(angle, Vector3d::UnitX()); }
Quaterniond TurnY(double angle) { return Turn(angle, Vector3d::UnitY()); }
Quaterniond TurnZ(double angle) { return Turn(angle, Vector3d::UnitZ()); }

using Turns = std::vector<Quaterniond>;

/// The bones of a body and how its arms hang at rest.
struct Joints {
  explicit Joints(const body::BodyTemplate& body) : bones(body::FindRoleBones(body)) {
    for (int side = 0; side < 2; ++side) {
      const Vector3d arm = body.bone_tails.col(bones.arms[side][1]) - body.bone_heads.col(bones.arms[side][1]);
      const double angle = std::atan2(std::abs(arm[0]), -arm[2]);
      arm_raised[side] = std::abs(angle - kPi / 4) < 1e-6 ? kPi / 4 : angle;  // exact for the mannequin
    }
  }

  /// The axis about which an elbow bends forwards.
  Vector3d ElbowAxis(bool left) const {
    const double sign = left ? 1 : -1, raised = arm_raised[left ? 0 : 1];
    return Vector3d(-1, 0, raised == kPi / 4 ? -sign : -sign * std::tan(std::min(raised, 1.55))).normalized();
  }

  body::RoleBones bones;
  double arm_raised[2];  // rad from hanging, left and right
};

/// Two shares of a turn, over all bones of a chain; a bone of two has one share.
void Spread(const Quaterniond& share, const std::vector<int>& chain, Turns* turns) {
  const auto count = static_cast<double>(chain.size());
  for (const int bone : chain) (*turns)[bone] = chain.size() == 2 ? share : Quaterniond::Identity().slerp(2 / count, share);
}

void PoseTrunk(const Joints& joints, const Signals& s, double t, double size, Turns* turns) {
  const Quaterniond half = TurnZ(size * 0.14 * s(1, t)) * TurnX(size * (-0.04 + 0.09 * s(2, t))) * TurnY(size * 0.07 * s(3, t));
  Spread(half, joints.bones.spine, turns);
  const Quaterniond look = TurnZ(size * 0.26 * s(4, t)) * TurnX(size * 0.10 * s(5, t));
  std::vector<int> neck = joints.bones.neck;
  neck.push_back(joints.bones.head);
  Spread(look, neck, turns);
}

/// `raise` and `swing` are angles from hanging, sideways and forward.
void PoseArm(const Joints& joints, const Signals& s, double t, bool left, Turns* turns) {
  const int channel = left ? 10 : 20;
  const double sign = left ? 1 : -1;
  const double raise = 0.72 + 0.58 * s(channel, t), swing = 0.40 + 0.85 * s(channel + 1, t),
               bend = 0.85 + 0.80 * s(channel + 2, t);
  const Vector3d elbow_axis = joints.ElbowAxis(left);
  const auto& arm = joints.bones.arms[left ? 0 : 1];
  (*turns)[arm[1]] = TurnX(-swing) * TurnY(sign * (joints.arm_raised[left ? 0 : 1] - raise));
  (*turns)[arm[2]] = Turn(std::max(0.05, bend), elbow_axis);
  (*turns)[arm[3]] = Turn(0.3 * s(channel + 3, t), elbow_axis);
}

void PoseLeg(const Joints& joints, const Signals& s, double t, bool left, Turns* turns) {
  const double sign = left ? 1 : -1;
  const double phase = 2 * kPi * 0.83 * t + (left ? 0 : kPi) + 0.5 * s(30, t);
  const double crouch = 0.13 * (1 + s(31, t)), stride = 0.30 + 0.14 * s(32, t);
  const double lift = std::pow(0.5 * (1 + std::cos(phase)), 2);
  const double flex = stride * std::sin(phase) + crouch + 0.12 * lift;
  const double knee = 0.10 + 0.62 * lift + 2 * crouch;
  const double spread = 0.045 + 0.035 * s(33, t);
  const auto& leg = joints.bones.legs[left ? 0 : 1];
  (*turns)[leg[0]] = TurnX(-flex) * TurnY(-sign * spread) * TurnZ(sign * 0.08);
  (*turns)[leg[1]] = TurnX(knee);
  (*turns)[leg[2]] = TurnX(std::clamp(0.75 * (flex - knee), -0.5, 0.35));
}

/// Arms 45 degrees off the body, elbows almost straight; one leg after the other is lifted a little, a step in a second.
void PoseTurnLimbs(const Joints& joints, const Signals& s, double t, bool left, Turns* turns) {
  const double sign = left ? 1 : -1;
  const int side = left ? 0 : 1, channel = left ? 10 : 20;
  const auto& arm = joints.bones.arms[side];
  (*turns)[arm[1]] =
      TurnX(-0.07 * s(channel + 1, t)) * TurnY(sign * (joints.arm_raised[side] - kPi / 4 + 0.06 * s(channel, t)));
  (*turns)[arm[2]] = Turn(0.05 * (1 + s(channel + 2, t)), joints.ElbowAxis(left));
  const double lift = std::pow(std::max(0.0, std::sin(2 * kPi * 0.5 * t + (left ? 0 : kPi))), 2);
  const auto& leg = joints.bones.legs[side];
  (*turns)[leg[0]] = TurnX(-0.16 * lift) * TurnY(-sign * 0.03);
  (*turns)[leg[1]] = TurnX(0.30 * lift);
  (*turns)[leg[2]] = TurnX(-0.14 * lift);
}

/// The pose with its lowest point on the floor.
body::BodyPose OnFloor(const body::BodyTemplate& body, const geometry::Rigid3& world_from_body, const Turns& turns) {
  body::BodyPose pose = body::PoseFromAngles(body, world_from_body, turns);
  const double lowest = body::SkinVertices(body, pose).row(2).minCoeff();
  for (geometry::Rigid3& bone : pose.bone_transforms) bone.translation[2] -= lowest;
  return pose;
}

}  // namespace

geometry::Rigid3 BoardPose(const calib::Board& board, int frame_idx, int num_frames, uint64_t seed) {
  MVS_CHECK(frame_idx >= 0 && frame_idx < num_frames, "frame " << frame_idx << " of " << num_frames);
  if (frame_idx == 0) return {TurnX(kPi), Vector3d::Zero()};
  const Signals s(seed + 77);
  const double progress = static_cast<double>(frame_idx) / num_frames, t = 24 * progress;
  const double azimuth = 2 * kPi * 2 * progress + 0.35 * s(1, t);
  const double up = DegToRad(25 + 28 * std::sin(2 * kPi * 5.3 * progress) + 4 * s(2, t)), roll = 0.7 * s(3, 2 * t);
  const Vector3d normal(std::cos(up) * std::cos(azimuth), std::cos(up) * std::sin(azimuth), std::sin(up));
  Eigen::Matrix3d rotation;
  rotation.col(2) = -normal;
  rotation.col(0) = rotation.col(2).cross(Vector3d::UnitZ()).normalized();
  rotation.col(1) = rotation.col(2).cross(rotation.col(0));
  const Quaterniond world_from_board = Quaterniond(rotation) * TurnZ(roll);
  Vector3d place(2.2 * s(4, 1.7 * t), 2.2 * s(5, 1.7 * t), 0);
  place *= std::min(1.0, 1.05 / std::max(1e-9, place.norm()));
  place[2] = 1.05 + std::clamp(1.4 * s(6, 1.7 * t), -0.45, 0.55);
  const Vector3d middle(0.5 * (board.cols - 1) * board.square_m, 0.5 * (board.rows - 1) * board.row_step(), 0);
  return {world_from_board.normalized(), place - world_from_board.normalized() * middle};
}

body::BodyPose PersonPose(const body::BodyTemplate& body, double time_s, uint64_t seed) {
  const Signals s(seed);
  const Joints joints(body);
  Turns turns(body.bone_names.size(), Quaterniond::Identity());
  PoseTrunk(joints, s, time_s, 1, &turns);
  for (bool left : {true, false}) {
    PoseArm(joints, s, time_s, left, &turns);
    PoseLeg(joints, s, time_s, left, &turns);
  }
  const double heading = 2 * kPi * 0.31 * time_s + 0.5 * s(40, time_s);
  const Vector3d place(0.32 * s(41, time_s), 0.32 * s(42, time_s), 0);
  return OnFloor(body, {TurnZ(heading), place}, turns);
}

body::BodyPose TurnPose(const body::BodyTemplate& body, double time_s, double duration_s, uint64_t seed) {
  const Signals s(seed);
  const Joints joints(body);
  Turns turns(body.bone_names.size(), Quaterniond::Identity());
  PoseTrunk(joints, s, time_s, 0.3, &turns);
  for (bool left : {true, false}) PoseTurnLimbs(joints, s, time_s, left, &turns);
  const double heading = 2 * kPi * time_s / duration_s + 0.04 * s(40, time_s);
  return OnFloor(body, {TurnZ(heading), Vector3d(0.015 * s(41, time_s), 0.015 * s(42, time_s), 0)}, turns);
}

Eigen::Matrix3Xd PersonJoints(const body::BodyTemplate& body, const body::BodyPose& pose, const geometry::Skeleton& skeleton) {
  const Eigen::Matrix3Xd coco19 = body::PosedCoco19(body, pose);
  const double scale = body.coco19(2, 0) / 1.43;  // the neck of a person of 1.75 m rests at 1.43 m
  const std::pair<const char*, Vector3d> foot_points[] = {
      {"BigToe", {0.108, -0.165, 0.025}}, {"SmallToe", {0.150, -0.105, 0.025}}, {"Heel", {0.110, 0.055, 0.035}}};
  const body::RoleBones bones = body::FindRoleBones(body);
  Eigen::Matrix3Xd joints(3, skeleton.joints.size());
  for (size_t j = 0; j < skeleton.joints.size(); ++j) {
    const int panoptic = geometry::Coco19().Find(skeleton.joints[j]);
    if (panoptic >= 0) {
      joints.col(j) = coco19.col(panoptic);
      continue;
    }
    bool found = false;
    for (const auto& [name, left_point] : foot_points) {
      if (skeleton.joints[j].substr(1) != name) continue;
      const bool left = skeleton.joints[j][0] == 'L';
      const Vector3d rest = scale * Vector3d(left ? left_point[0] : -left_point[0], left_point[1], left_point[2]);
      const Vector3d from_ankle = body.coco19.col(left ? 8 : 14) - scale * Vector3d(left ? 0.112 : -0.112, 0.018, 0.085);
      const Vector3d shift = from_ankle.norm() < 1e-9 ? Vector3d::Zero() : from_ankle;  // exact for the mannequin
      joints.col(j) = pose.bone_transforms[bones.legs[left ? 0 : 1][2]] * (rest + shift);
      found = true;
    }
    MVS_CHECK(found, "the person has no joint called " << skeleton.joints[j]);
  }
  return joints;
}

}  // namespace mvstudio::synth
