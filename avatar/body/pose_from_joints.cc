#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "avatar/body/body_template.h"
#include "avatar/body/role_bones.h"
#include "core/check.h"
#include "core/statistics.h"
#include "geometry/rigid/decompositions.h"

namespace mvstudio::body {
namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

// Panoptic's joints.
enum Joint {
  kNeckJ,
  kNose,
  kCenter,
  kShoulderL,
  kElbowL,
  kWristL,
  kHipL,
  kKneeL,
  kAnkleL,
  kShoulderR,
  kElbowR,
  kWristR,
  kHipR,
  kKneeR,
  kAnkleR,
  kEyeL,
  kEarL,
  kEyeR,
  kEarR
};
constexpr int kFace[] = {kNose, kEyeL, kEarL, kEyeR, kEarR};

struct Joints {
  Eigen::Matrix3Xd x;
  std::array<bool, 19> has;
  void Set(int j, const Vector3d& value) {
    if (!has[j]) x.col(j) = value, has[j] = true;
  }
};

/// Orthonormal frame with x exactly along `x_hint`-in-plane and z along `z`.
Matrix3d FrameFromZ(const Vector3d& z, const Vector3d& x_hint) {
  Matrix3d frame;
  frame.col(2) = z.normalized();
  frame.col(0) = (x_hint - frame.col(2) * frame.col(2).dot(x_hint)).normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

/// One of a pair from the other and the middle.
void MirrorPair(int left, int right, int middle, Joints* joints) {
  if (joints->has[left] == joints->has[right] || !joints->has[middle]) return;
  const int known = joints->has[left] ? left : right;
  joints->Set(known == left ? right : left, 2 * joints->x.col(middle) - joints->x.col(known));
}

/// Median over the limb bones that have both ends of measured over rest length.
double MedianScale(const BodyTemplate& body, const Joints& joints) {
  static constexpr int kBones[][2] = {{kNeckJ, kCenter},  {kShoulderL, kElbowL}, {kElbowL, kWristL},
                                      {kHipL, kKneeL},    {kKneeL, kAnkleL},     {kShoulderR, kElbowR},
                                      {kElbowR, kWristR}, {kHipR, kKneeR},       {kKneeR, kAnkleR}};
  std::vector<double> ratios;
  for (const auto& bone : kBones) {
    if (!joints.has[bone[0]] || !joints.has[bone[1]]) continue;
    const double rest = (body.coco19.col(bone[0]) - body.coco19.col(bone[1])).norm();
    ratios.push_back((joints.x.col(bone[0]) - joints.x.col(bone[1])).norm() / rest);
  }
  return std::clamp(UpperMedian(std::move(ratios), 1), 0.2, 5.0);
}

/// Neck, body centre, shoulders and hips; false when they cannot be had.
bool CompleteTrunk(const BodyTemplate& body, Joints* joints) {
  auto& has = joints->has;
  if (has[kShoulderL] && has[kShoulderR]) joints->Set(kNeckJ, 0.5 * (joints->x.col(kShoulderL) + joints->x.col(kShoulderR)));
  if (has[kHipL] && has[kHipR]) joints->Set(kCenter, 0.5 * (joints->x.col(kHipL) + joints->x.col(kHipR)));
  MirrorPair(kShoulderL, kShoulderR, kNeckJ, joints);
  MirrorPair(kHipL, kHipR, kCenter, joints);
  if (!has[kNeckJ] || !has[kCenter] || (!has[kShoulderL] && !has[kHipL])) return false;
  const Vector3d up = joints->x.col(kNeckJ) - joints->x.col(kCenter);
  const int l = has[kShoulderL] ? kShoulderL : kHipL, r = has[kShoulderL] ? kShoulderR : kHipR;
  const Vector3d side = joints->x.col(l) - joints->x.col(r);
  if (!(up.norm() > 1e-6) || !(side.cross(up).norm() > 1e-9)) return false;
  const auto rest = [&body](int a, int b) { return Vector3d(body.coco19.col(a) - body.coco19.col(b)); };
  const Matrix3d frame = FrameFromZ(up, side) * FrameFromZ(rest(kNeckJ, kCenter), rest(l, r)).transpose();
  const double scale = MedianScale(body, *joints);
  for (int j : {kShoulderL, kShoulderR}) {
    joints->Set(j, joints->x.col(kNeckJ) + scale * frame * (body.coco19.col(j) - body.coco19.col(kNeckJ)));
  }
  for (int j : {kHipL, kHipR}) {
    joints->Set(j, joints->x.col(kCenter) + scale * frame * (body.coco19.col(j) - body.coco19.col(kCenter)));
  }
  const Vector3d hips = joints->x.col(kHipL) - joints->x.col(kHipR);
  const Vector3d shoulders = joints->x.col(kShoulderL) - joints->x.col(kShoulderR);
  return hips.cross(up).norm() > 1e-9 && shoulders.cross(up).norm() > 1e-9;
}

class Poser {
 public:
  Poser(const BodyTemplate& body, const Joints& joints, BodyPose* pose)
      : body_(body), bones_(FindRoleBones(body)), joints_(joints), pose_(*pose), girth_(MedianScale(body, joints)) {
    pose_.bone_transforms.assign(body.bone_names.size(), {});
    pose_.bone_stretch.assign(body.bone_names.size(), girth_);
    pose_.girth = girth_;
  }

  void Run() {
    Trunk();
    Head();
    for (bool left : {true, false}) {
      Arm(left);
      Leg(left);
    }
    Followers();
  }

 private:
  Vector3d RestVector(int bone) const { return body_.bone_tails.col(bone) - body_.bone_heads.col(bone); }
  Quaterniond Rotation(int bone) const { return pose_.bone_transforms[bone].rotation; }

  Vector3d Scaled(int bone, const Vector3d& d) const {
    const Vector3d dir = RestVector(bone).normalized();
    return girth_ * d + (pose_.bone_stretch[bone] - girth_) * dir * dir.dot(d);
  }

  /// Where a rest point that follows `bone` alone ends up.
  Vector3d Posed(int bone, const Vector3d& x_in_body) const {
    const Vector3d head = body_.bone_heads.col(bone);
    return pose_.bone_transforms[bone] * (head + Scaled(bone, x_in_body - head));
  }

  void Place(int bone, const Quaterniond& rotation, const Vector3d& head_in_world, double stretch) {
    pose_.bone_transforms[bone] = {rotation.normalized(), head_in_world - rotation.normalized() * body_.bone_heads.col(bone)};
    pose_.bone_stretch[bone] = std::clamp(stretch, 0.1, 10.0);
  }

  /// Least turn of `from` that brings the bone's direction to `direction`.
  Quaterniond Swing(int bone, const Quaterniond& from, const Vector3d& direction) const {
    if (!(direction.norm() > 1e-9)) return from;
    return Quaterniond::FromTwoVectors(from * RestVector(bone), direction) * from;
  }

  /// Points a bone from `head` to `tail`, starting from the parent's rotation.
  void Point(int bone, const Quaterniond& from, const Vector3d& head, const Vector3d& tail) {
    Place(bone, Swing(bone, from, tail - head), head, (tail - head).norm() / RestVector(bone).norm());
  }

  /// Bones one after the other from `start` to `end`, in the shape of their rest chain turned by `turn` and stretched to fit.
  /// They share the turn from one rotation to the other in `shares` steps; a bone that takes the last one has it exactly.
  void PlaceChain(const std::vector<int>& bones, const Vector3d& start, const Vector3d& end, const Quaterniond& turn,
                  const Quaterniond& from, const Quaterniond& to, size_t shares) {
    const Vector3d along = end - start;
    const Vector3d chord = (body_.bone_tails.col(bones.back()) - body_.bone_heads.col(bones[0])).normalized();
    double length = 0;
    for (const int b : bones) length += RestVector(b).dot(chord);
    Vector3d head = start;
    for (size_t i = 0; i < bones.size(); ++i) {
      const int b = bones[i];
      const bool on_chord = (RestVector(b) - chord * chord.dot(RestVector(b))).isZero(0);
      const double share = static_cast<double>(i + 1) / static_cast<double>(shares);
      const Quaterniond rotation =
          i + 1 == shares ? to : Swing(b, from.slerp(share, to), on_chord ? along : turn * RestVector(b));
      Place(b, rotation, head, along.norm() / length);
      head = Posed(b, body_.bone_tails.col(b));
    }
  }

  /// Frame of the hips: x exactly along them, z towards the neck.
  static Matrix3d HipFrame(const Vector3d& hips, const Vector3d& up) {
    Matrix3d frame;
    frame.col(0) = hips.normalized();
    frame.col(2) = (up - frame.col(0) * frame.col(0).dot(up)).normalized();
    frame.col(1) = frame.col(2).cross(frame.col(0));
    return frame;
  }

  void Trunk() {
    const auto& x = joints_.x;
    const auto& rest = body_.coco19;
    const int pelvis = bones_.pelvis;
    const Vector3d center = x.col(kCenter), neck = x.col(kNeckJ), hips = x.col(kHipL) - x.col(kHipR);
    const Vector3d rest_hips = rest.col(kHipL) - rest.col(kHipR);
    const Matrix3d frame =
        HipFrame(hips, neck - center) * HipFrame(rest_hips, rest.col(kNeckJ) - rest.col(kCenter)).transpose();
    Place(pelvis, Quaterniond(frame), center, hips.norm() / rest_hips.norm());
    pose_.bone_transforms[pelvis].translation -=
        Rotation(pelvis) * Scaled(pelvis, rest.col(kCenter) - body_.bone_heads.col(pelvis));
    const Vector3d rest_head = body_.bone_heads.col(bones_.spine[0]), spine_head = Posed(pelvis, rest_head);
    const Matrix3d rest_frame = FrameFromZ(rest.col(kNeckJ) - rest_head, rest.col(kShoulderL) - rest.col(kShoulderR));
    const Matrix3d chest_frame = FrameFromZ(neck - spine_head, x.col(kShoulderL) - x.col(kShoulderR)) * rest_frame.transpose();
    const Quaterniond chest(chest_frame);
    PlaceChain(bones_.spine, spine_head, neck, chest, Rotation(pelvis), chest, bones_.spine.size());
  }

  /// Rotation of the head that best fits the face points, or nothing when they do not fix one.
  std::optional<Quaterniond> FaceRotation(const Quaterniond& prior) const {
    Vector3d rest_mean = Vector3d::Zero(), mean = Vector3d::Zero();
    int count = 0;
    for (int j : kFace) {
      if (joints_.has[j]) rest_mean += body_.coco19.col(j), mean += joints_.x.col(j), ++count;
    }
    if (count < 2) return std::nullopt;
    rest_mean /= count, mean /= count;
    Matrix3d correlation = Matrix3d::Zero();
    for (int j : kFace) {
      if (joints_.has[j]) correlation += (joints_.x.col(j) - mean) * (body_.coco19.col(j) - rest_mean).transpose();
    }
    const double weight = count >= 3 ? 1e-9 : 0.05;
    correlation += weight * correlation.norm() * prior.toRotationMatrix();
    if (!(correlation.norm() > 1e-12)) return std::nullopt;
    return Quaterniond(geometry::ProcrustesRotation(correlation));
  }

  void Head() {
    const int head = bones_.head, first = bones_.neck.front(), chest = bones_.spine.back();
    const Vector3d rest_neck = body_.bone_heads.col(first);
    const Vector3d neck_in_world =
        joints_.x.col(kNeckJ) + Rotation(chest) * Scaled(chest, rest_neck - body_.coco19.col(kNeckJ));
    const Quaterniond rotation = FaceRotation(Rotation(chest)).value_or(Rotation(chest));
    const Vector3d rest_chord = body_.bone_tails.col(bones_.neck.back()) - rest_neck;
    Vector3d sum = Vector3d::Zero();
    int count = 0;
    for (int j : kFace) {
      if (!joints_.has[j]) continue;
      sum += joints_.x.col(j) - girth_ * (rotation * (body_.coco19.col(j) - body_.bone_heads.col(head)));
      ++count;
    }
    const Vector3d head_in_world = count > 0 ? Vector3d(sum / count) : neck_in_world + girth_ * (rotation * rest_chord);
    const Quaterniond half = Rotation(chest).slerp(0.5, rotation);
    Quaterniond turn = half;
    if ((head_in_world - neck_in_world).norm() > 1e-9)
      turn = Quaterniond::FromTwoVectors(half * rest_chord, head_in_world - neck_in_world) * half;
    PlaceChain(bones_.neck, neck_in_world, head_in_world, turn, Rotation(chest), rotation, bones_.neck.size() + 1);
    Place(head, rotation, head_in_world, girth_);
  }

  /// Rest offset of a missing joint in its parent's frame, or on the way to the joint after it.
  Vector3d LimbJoint(int bone, const Quaterniond& from, const Vector3d& head, int joint, int next) const {
    if (joints_.has[joint]) return joints_.x.col(joint);
    if (next >= 0 && joints_.has[next]) {
      const Vector3d way = joints_.x.col(next) - head;
      if (way.norm() > 1e-6) return head + 0.5 * way;
    }
    return head + girth_ * (from * RestVector(bone));
  }

  void Arm(bool left) {
    const auto [clavicle, upper, fore, hand] = bones_.arms[left ? 0 : 1];
    const int offset = left ? 0 : kShoulderR - kShoulderL;
    const Quaterniond chest = Rotation(bones_.spine.back());
    const Vector3d shoulder = joints_.x.col(kShoulderL + offset);
    Point(clavicle, chest, Posed(bones_.spine.back(), body_.bone_heads.col(clavicle)), shoulder);
    const Vector3d elbow = LimbJoint(upper, chest, shoulder, kElbowL + offset, kWristL + offset);
    Point(upper, chest, shoulder, elbow);
    const Vector3d wrist = LimbJoint(fore, Rotation(upper), elbow, kWristL + offset, -1);
    Point(fore, Rotation(upper), elbow, wrist);
    Place(hand, Rotation(fore), wrist, girth_);
  }

  /// Turns the thigh about itself so that the knee bends backwards, the more the clearer the bend.
  Quaterniond AlignKnee(int thigh, const Quaterniond& rotation, const Vector3d& shin_direction) const {
    const Vector3d axis = (rotation * RestVector(thigh)).normalized();
    const Vector3d back = rotation * Vector3d::UnitY(), bend = shin_direction.normalized();
    const Vector3d bend_plane = bend - axis * axis.dot(bend), back_plane = back - axis * axis.dot(back);
    const double t = std::clamp((bend_plane.norm() - 0.25) / 0.35, 0.0, 1.0);
    if (t <= 0) return rotation;
    const double angle = std::atan2(axis.dot(back_plane.cross(bend_plane)), back_plane.dot(bend_plane));
    const double limit = 0.9;  // rad; a larger twist means the joints are wrong, not the leg
    return Quaterniond(Eigen::AngleAxisd(t * t * (3 - 2 * t) * std::clamp(angle, -limit, limit), axis)) * rotation;
  }

  void Leg(bool left) {
    const auto [thigh, shin, foot] = bones_.legs[left ? 0 : 1];
    const int offset = left ? 0 : kHipR - kHipL;
    const Quaterniond pelvis = Rotation(bones_.pelvis);
    const Vector3d hip = joints_.x.col(kHipL + offset);
    const Vector3d knee = LimbJoint(thigh, pelvis, hip, kKneeL + offset, kAnkleL + offset);
    Point(thigh, pelvis, hip, knee);
    const Vector3d ankle = LimbJoint(shin, Rotation(thigh), knee, kAnkleL + offset, -1);
    if ((ankle - knee).norm() > 1e-6)
      Place(thigh, AlignKnee(thigh, Rotation(thigh), ankle - knee), hip, pose_.bone_stretch[thigh]);
    Point(shin, Rotation(thigh), knee, ankle);
    Place(foot, Rotation(shin), ankle, girth_);
  }

  /// The bones without a role.
  void Followers() {
    for (size_t b = 0; b < body_.bone_roles.size(); ++b) {
      if (body_.bone_roles[b] != BoneRole::kOther) continue;
      const int leader = body_.bone_parents[b] < 0 ? bones_.pelvis : body_.bone_parents[b];
      Place(static_cast<int>(b), Rotation(leader), Posed(leader, body_.bone_heads.col(b)), girth_);
    }
  }

  const BodyTemplate& body_;
  const RoleBones bones_;
  const Joints& joints_;
  BodyPose& pose_;
  double girth_;
};

}  // namespace

bool PoseFromJoints(const BodyTemplate& body, const Eigen::Matrix3Xd& coco19_in_world, const std::array<bool, 19>& valid,
                    BodyPose* pose) {
  MVS_CHECK(coco19_in_world.cols() == 19, coco19_in_world.cols() << " joints instead of 19");
  Joints joints{coco19_in_world, valid};
  for (int j = 0; j < 19; ++j) {
    if (valid[j] && !coco19_in_world.col(j).allFinite()) return false;
  }
  if (!CompleteTrunk(body, &joints)) return false;
  Poser(body, joints, pose).Run();
  return true;
}

}  // namespace mvstudio::body
