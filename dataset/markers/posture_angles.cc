#include "dataset/markers/posture_angles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "core/units.h"
#include "geometry/skeleton/skeleton_text.h"

namespace mvstudio::markers::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Sines of what is too straight for a rotation about itself, and cosines of what is too near to a pole.
const double kLeastBend = std::sin(DegToRad(15)), kLeastCosine = std::cos(DegToRad(80));

/// x forward, y up, z to the right, from what is nearly up and a direction to the right; `z_first`: z is kept, else y.
struct Segment {
  Matrix3d axes = Matrix3d::Constant(std::nan(""));  ///< columns x, y, z
  bool ok = false;

  Segment(const Vector3d& up, const Vector3d& right, bool z_first) {
    if (!up.allFinite() || !right.allFinite()) return;
    const Vector3d kept = (z_first ? right : up).normalized(), other = z_first ? up : right;
    const Vector3d across = other - other.dot(kept) * kept;
    if (!(across.norm() > 0.1 * other.norm())) return;
    const Vector3d y = z_first ? across.normalized() : kept, z = z_first ? kept : across.normalized();
    axes << y.cross(z), y, z;
    ok = true;
  }
  Vector3d From(const Vector3d& v) const { return axes.transpose() * v; }
};

/// Angles of a limb whose direction towards the trunk is `up` in axes of its parent: R = Rz(flexion) Rx(adduction) …
struct Swing {
  double flexion = 0, adduction = 0;
  Matrix3d axes;
  explicit Swing(const Vector3d& up)
      : flexion(std::atan2(-up.x(), up.y())), adduction(std::asin(std::clamp(up.z(), -1.0, 1.0))) {
    axes = (Eigen::AngleAxisd(flexion, Vector3d::UnitZ()) * Eigen::AngleAxisd(adduction, Vector3d::UnitX())).toRotationMatrix();
  }
  bool NearPole() const { return std::cos(adduction) < kLeastCosine; }
};

/// One posture.
class Posture {
 public:
  Posture(const std::vector<Vector3d>& roles, bool has_up) : p_(roles), has_up_(has_up) {
    result_.rad.assign(AngleDefinitions().size(), std::nan(""));
    result_.status.assign(AngleDefinitions().size(), AngleStatus::kMissingJoint);
    const Vector3d shoulders = (p_[kLShoulder] + p_[kRShoulder]) / 2;
    top_ = shoulders.allFinite() ? shoulders : p_[kNeck];
    hips_ = (p_[kLHip] + p_[kRHip]) / 2;
  }

  RawAngles Compute() {
    const Segment pelvis(top_ - hips_, p_[kRHip] - p_[kLHip], true);
    const Vector3d base = hips_.allFinite() ? hips_ : p_[kMidHip];
    const Segment thorax(top_ - base, p_[kRShoulder] - p_[kLShoulder], false);
    AgainstWorld(pelvis);
    Trunk(pelvis, thorax);
    Neck(thorax);
    for (const bool left : {false, true}) {
      Leg(pelvis, left);
      Arm(thorax, left);
    }
    return std::move(result_);
  }

 private:
  void Set(size_t angle, double rad, AngleStatus status = AngleStatus::kOk) {
    if (status == AngleStatus::kOk && !std::isfinite(rad)) status = AngleStatus::kMissingJoint;
    result_.rad[angle] = rad, result_.status[angle] = status;
  }

  void AgainstWorld(const Segment& pelvis) {
    if (!has_up_) {
      for (size_t a = kHeading; a <= kTrunkBending; ++a) result_.status[a] = AngleStatus::kNoUp;
      return;
    }
    const Vector3d right = p_[kRHip] - p_[kLHip], trunk = top_ - hips_;
    const Vector3d level(right.x(), 0, right.z());
    const AngleStatus pole = level.norm() < kLeastCosine * right.norm() ? AngleStatus::kGimbal : AngleStatus::kOk;
    Set(kHeading, std::atan2(level.x(), level.z()), pole);
    Set(kObliquity, std::asin(std::clamp(-right.y() / right.norm(), -1.0, 1.0)));
    const Vector3d z = level.normalized(), x = Vector3d::UnitY().cross(z);
    Set(kTrunkFlexion, std::atan2(trunk.dot(x), trunk.y()), pole);
    Set(kTrunkBending, std::atan2(trunk.dot(z), trunk.y()), pole);
    if (!pelvis.ok) return;
    const Swing swing(pelvis.axes.col(1));
    const AngleStatus status = swing.NearPole() ? AngleStatus::kGimbal : AngleStatus::kOk;
    Set(kTilt, swing.flexion, status), Set(kList, swing.adduction);
    Set(kRotation, std::atan2(-pelvis.axes(2, 0), pelvis.axes(2, 2)), status);
  }

  void Trunk(const Segment& pelvis, const Segment& thorax) {
    if (!pelvis.ok || !thorax.ok) return;
    const Matrix3d r = pelvis.axes.transpose() * thorax.axes;
    const Swing swing(r.col(1));
    Set(kLumbarBending, swing.adduction);
    Set(kLumbarRotation, std::atan2(-r(2, 0), r(2, 2)), swing.NearPole() ? AngleStatus::kGimbal : AngleStatus::kOk);
  }

  void Neck(const Segment& thorax) {
    const Vector3d ears = (p_[kLEar] + p_[kREar]) / 2;
    const Vector3d head = thorax.From((ears.allFinite() ? ears : p_[kHead]) - top_);
    Set(kNeckFlexion, std::atan2(head.x(), head.y()));
    Set(kNeckBending, std::atan2(head.z(), head.y()));
    const Vector3d line = thorax.From(p_[kREar] - p_[kLEar]);
    const double level = std::hypot(line.x(), line.z());
    Set(kNeckRotation, std::atan2(line.x(), line.z()),
        level < kLeastCosine * line.norm() ? AngleStatus::kGimbal : AngleStatus::kOk);
  }

  /// In axes of the parent; of the left side as its mirror image, the right one.
  Vector3d Direction(const Segment& parent, const Vector3d& v, bool left) const {
    Vector3d d = parent.From(v).normalized();
    if (left) d.z() = -d.z();
    return d;
  }

  void Leg(const Segment& pelvis, bool left) {
    const size_t at = kNumTrunk + (left ? kNumSide : 0);
    const Vector3d &hip = p_[kLHip + !left], &knee = p_[kLKnee + !left], &ankle = p_[kLAnkle + !left];
    Ankle(at, left);
    const Swing swing(Direction(pelvis, hip - knee, left));
    const AngleStatus pole = swing.NearPole() ? AngleStatus::kGimbal : AngleStatus::kOk;
    Set(at + kHipFlexion, swing.flexion, pole), Set(at + kHipAdduction, swing.adduction);
    const Vector3d shank = swing.axes.transpose() * Direction(pelvis, ankle - knee, left);
    const double bend = std::hypot(shank.x(), shank.z());
    // Behind the thigh it is flexion, before it the knee is overstretched.
    const double sign = shank.x() > 0 ? -1 : 1;
    Set(at + kKneeFlexion, sign * std::atan2(bend, -shank.y()));
    const AngleStatus straight = bend < kLeastBend ? AngleStatus::kStraightLimb : pole;
    Set(at + kHipRotation, std::atan2(sign * shank.z(), -sign * shank.x()), straight);
    if (!pelvis.ok) KneeAlone(at, hip - knee, ankle - knee);
  }

  /// Without a pelvis nothing says which side is the front: the angle alone.
  void KneeAlone(size_t at, const Vector3d& thigh, const Vector3d& shank) {
    Set(at + kKneeFlexion, std::atan2(thigh.cross(shank).norm(), -thigh.dot(shank)));
  }

  void Ankle(size_t at, bool left) {
    const Vector3d &big = p_[kLToe + !left], &small = p_[kLSmallToe + !left];
    const Vector3d toes = small.allFinite() ? Vector3d((big + small) / 2) : big;
    const Vector3d foot = toes - p_[kLHeel + !left], shank = p_[kLKnee + !left] - p_[kLAnkle + !left];
    Set(at + kAnkle, kPi / 2 - std::atan2(foot.cross(shank).norm(), foot.dot(shank)));
  }

  void Arm(const Segment& thorax, bool left) {
    const size_t at = kNumTrunk + (left ? kNumSide : 0);
    const Vector3d &shoulder = p_[kLShoulder + !left], &elbow = p_[kLElbow + !left];
    const Vector3d upper = shoulder - elbow, fore = p_[kLWrist + !left] - elbow;
    Set(at + kElbow, std::atan2(upper.cross(fore).norm(), -upper.dot(fore)));
    const Vector3d up = Direction(thorax, upper, left), forearm = Direction(thorax, fore, left);
    const double away = std::hypot(up.x(), up.z()), bend = upper.cross(fore).norm() / (upper.norm() * fore.norm());
    const double plane = std::atan2(-up.x(), -up.z()), elevation = std::atan2(away, up.y());
    const AngleStatus hangs = away < kLeastBend ? AngleStatus::kGimbal : AngleStatus::kOk;
    const AngleStatus straight = bend < kLeastBend ? AngleStatus::kStraightLimb : AngleStatus::kOk;
    Set(at + kPlane, plane, hangs), Set(at + kElevation, elevation);
    const auto rotation = [&](const Matrix3d& axes) {
      const Vector3d w = axes.transpose() * forearm;
      return std::atan2(-w.z(), w.x());
    };
    const Matrix3d yx =
        (Eigen::AngleAxisd(plane, Vector3d::UnitY()) * Eigen::AngleAxisd(-elevation, Vector3d::UnitX())).toRotationMatrix();
    Set(at + kShoulderRotation, rotation(yx), straight == AngleStatus::kOk ? hangs : straight);
    const Swing swing(up);
    const AngleStatus pole = swing.NearPole() ? AngleStatus::kGimbal : AngleStatus::kOk;
    Set(at + kArmFlex, swing.flexion, pole), Set(at + kArmAdd, swing.adduction);
    Set(at + kArmRot, rotation(swing.axes), straight == AngleStatus::kOk ? pole : straight);
  }

  const std::vector<Vector3d>& p_;
  bool has_up_;
  Vector3d top_, hips_;
  RawAngles result_;
};

/// JointKey -> role. The second names are those of .bvh files, where a bone's joint bears the bone's name.
const std::map<std::string, std::vector<std::string>>& NamesOfRoles() {
  static const std::map<std::string, std::vector<std::string>> names = [] {
    std::map<std::string, std::vector<std::string>> keys;
    const std::vector<std::pair<std::string, std::vector<std::string>>> sides = {{"Hip", {"UpLeg", "Thigh"}},
                                                                                 {"Knee", {"Leg", "Shin", "Calf"}},
                                                                                 {"Ankle", {"Foot"}},
                                                                                 {"Heel", {}},
                                                                                 {"BigToe", {"ToeBase", "Toe"}},
                                                                                 {"SmallToe", {}},
                                                                                 {"Shoulder", {"Arm"}},
                                                                                 {"Elbow", {"ForeArm"}},
                                                                                 {"Wrist", {"Hand"}}};
    for (const auto& [own, others] : sides) {
      for (const std::string side : {"Left", "Right"}) {
        auto& list = keys[side[0] + own];
        list.push_back(geometry::JointKey(side[0] + own));
        for (const std::string& other : others) list.push_back(geometry::JointKey(side + other));
      }
    }
    for (const char* word : {"Neck", "Head", "LEar", "REar", "MidHip"}) keys[word] = {geometry::JointKey(word)};
    keys["MidHip"].push_back(geometry::JointKey("Hips"));
    return keys;
  }();
  return names;
}

/// A .bvh calls the collar bone a shoulder: then the upper arm's joint is the shoulder's centre.
int FindRole(const std::vector<std::string>& keys, const std::string& role) {
  std::vector<std::string> wanted = NamesOfRoles().at(role);
  const auto find = [&](const std::string& key) {
    const auto found = std::find(keys.begin(), keys.end(), key);
    return found == keys.end() ? -1 : static_cast<int>(found - keys.begin());
  };
  if (wanted.size() > 1 && role.find("Shoulder") != std::string::npos && find(wanted[1]) >= 0) return find(wanted[1]);
  for (const std::string& key : wanted) {
    if (find(key) >= 0) return find(key);
  }
  return -1;
}

}  // namespace

std::vector<int> RolesOf(const std::vector<std::string>& names) {
  constexpr const char* kRoleNames[kNumRoles] = {"LHip",      "RHip",      "LKnee",   "RKnee",   "LAnkle",    "RAnkle",
                                                 "LHeel",     "RHeel",     "LBigToe", "RBigToe", "LSmallToe", "RSmallToe",
                                                 "LShoulder", "RShoulder", "LElbow",  "RElbow",  "LWrist",    "RWrist",
                                                 "Neck",      "Head",      "LEar",    "REar",    "MidHip"};
  std::vector<std::string> keys;
  for (const std::string& name : names) keys.push_back(geometry::JointKey(name));
  std::vector<int> roles;
  for (const char* role : kRoleNames) roles.push_back(FindRole(keys, role));
  return roles;
}

RawAngles ComputeAngles(const std::vector<Vector3d>& roles, bool has_up) { return Posture(roles, has_up).Compute(); }

}  // namespace mvstudio::markers::internal
