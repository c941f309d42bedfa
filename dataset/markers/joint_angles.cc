#include "dataset/markers/joint_angles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/fields.h"
#include "core/units.h"
#include "dataset/markers/posture_angles.h"

namespace mvstudio::markers {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using namespace internal;

constexpr ChoiceWords<AngleStatus, 6> kStatusWords = {{{AngleStatus::kOk, "Ok"},
                                                       {AngleStatus::kMissingJoint, "MissingJoint"},
                                                       {AngleStatus::kStraightLimb, "StraightLimb"},
                                                       {AngleStatus::kGimbal, "Gimbal"},
                                                       {AngleStatus::kNoUp, "NoUp"},
                                                       {AngleStatus::kUncertain, "Uncertain"}}};

std::vector<AngleDefinition> MakeDefinitions() {
  std::vector<AngleDefinition> list = {{"pelvis_heading", ""},
                                       {"pelvis_obliquity", ""},
                                       {"pelvis_trunk_tilt", "pelvis_tilt"},
                                       {"pelvis_trunk_list", "pelvis_list"},
                                       {"pelvis_trunk_rotation", "pelvis_rotation"},
                                       {"trunk_flexion", ""},
                                       {"trunk_bending", ""},
                                       {"lumbar_bending", "lumbar_bending"},
                                       {"lumbar_rotation", "lumbar_rotation"},
                                       {"neck_flexion", ""},
                                       {"neck_bending", ""},
                                       {"neck_rotation", ""}};
  const std::vector<AngleDefinition> side = {{"hip_flexion", "hip_flexion"},
                                             {"hip_adduction", "hip_adduction"},
                                             {"hip_rotation", "hip_rotation"},
                                             {"knee_flexion", "knee_angle"},
                                             {"ankle_dorsiflexion", "ankle_angle"},
                                             {"shoulder_plane", ""},
                                             {"shoulder_elevation", ""},
                                             {"shoulder_rotation", ""},
                                             {"arm_flex", "arm_flex"},
                                             {"arm_add", "arm_add"},
                                             {"arm_rot", "arm_rot"},
                                             {"elbow_flexion", "elbow_flex"}};
  for (const char* suffix : {"_r", "_l"}) {
    for (const AngleDefinition& one : side)
      list.push_back({one.name + suffix, one.opensim.empty() ? "" : one.opensim + suffix});
  }
  return list;
}

/// Equivalent values nearest to the last ones: whole turns, and of arms the other solution of the sequence z, x, y.
class Continuity {
 public:
  explicit Continuity(size_t count) : last_(count, std::nan("")) {}

  void Follow(RawAngles* raw) {
    for (const size_t arm : {kNumTrunk + kArmFlex, kNumTrunk + kNumSide + kArmFlex}) FollowArm(arm, raw);
    for (size_t a = 0; a < last_.size(); ++a) {
      double& value = raw->rad[a];
      if (std::isfinite(value) && std::isfinite(last_[a])) value = Near(value, last_[a]);
      if (raw->status[a] == AngleStatus::kOk) last_[a] = value;
    }
  }

 private:
  static double Near(double value, double to) { return value - 2 * kPi * std::round((value - to) / (2 * kPi)); }

  void FollowArm(size_t first, RawAngles* raw) const {
    double* v = raw->rad.data() + first;
    const double other[3] = {v[0] + kPi, kPi - v[1], v[2] + kPi};
    double as_is = 0, rotated = 0;
    for (size_t k = 0; k < 3; ++k) {
      const double last = last_[first + k];
      if (!std::isfinite(v[k]) || !std::isfinite(last)) continue;
      as_is += std::abs(Near(v[k], last) - last), rotated += std::abs(Near(other[k], last) - last);
    }
    if (rotated < as_is) std::copy(other, other + 3, v);
  }

  std::vector<double> last_;
};

std::vector<Vector3d> PositionsAt(const MarkerTake& take, int frame, const std::vector<int>& roles) {
  std::vector<Vector3d> positions;
  for (const int marker : roles) {
    Vector3d x = Vector3d::Constant(std::nan(""));
    if (marker >= 0 && take.source[take.Index(frame, marker)] != Source::kMissing)
      x = take.x_in_world[take.Index(frame, marker)];
    positions.emplace_back(x.y(), x.z(), x.x());
  }
  return positions;
}

/// Variances (rad²) of the values by central differences; NaN where a joint that matters has no covariance.
std::vector<double> Variances(std::vector<Vector3d> positions, const std::vector<std::optional<Matrix3d>>& covariances,
                              bool has_up) {
  constexpr double kStep = 1e-5;  // metres
  std::vector<double> variance(AngleDefinitions().size(), 0);
  for (size_t r = 0; r < positions.size(); ++r) {
    if (!positions[r].allFinite()) continue;
    Eigen::MatrixX3d gradient(static_cast<Eigen::Index>(variance.size()), 3);
    for (int k = 0; k < 3; ++k) {
      const double at = positions[r][k];
      positions[r][k] = at + kStep;
      const RawAngles above = internal::ComputeAngles(positions, has_up);
      positions[r][k] = at - kStep;
      const RawAngles below = internal::ComputeAngles(positions, has_up);
      positions[r][k] = at;
      for (size_t a = 0; a < variance.size(); ++a)
        gradient(static_cast<Eigen::Index>(a), k) = std::remainder(above.rad[a] - below.rad[a], 2 * kPi) / (2 * kStep);
    }
    for (size_t a = 0; a < variance.size(); ++a) {
      const Eigen::RowVector3d g = gradient.row(static_cast<Eigen::Index>(a));
      if (g.isZero(0) || !g.allFinite()) continue;
      variance[a] += covariances[r] ? (g * *covariances[r] * g.transpose())(0, 0) : std::nan("");
    }
  }
  return variance;
}

}  // namespace

std::string_view ToString(AngleStatus status) { return WordOf(kStatusWords, status); }

const std::vector<AngleDefinition>& AngleDefinitions() {
  static const std::vector<AngleDefinition> definitions = MakeDefinitions();
  return definitions;
}

AngleTake AnglesOf(const MarkerTake& take, bool has_up, const CovarianceOf& covariance) {
  constexpr double kMostSigmaDeg = 30;
  const std::vector<int> roles = internal::RolesOf(take.names);
  AngleTake angles;
  angles.person = take.person, angles.rate_hz = take.rate_hz, angles.first_frame = take.first_frame;
  Continuity continuity(AngleDefinitions().size());
  for (int f = 0; f < take.num_frames(); ++f) {
    const std::vector<Vector3d> positions = PositionsAt(take, f, roles);
    RawAngles raw = internal::ComputeAngles(positions, has_up);
    std::vector<std::optional<Matrix3d>> covariances;
    for (const int marker : roles) {
      std::optional<Matrix3d> c;
      if (marker >= 0) c = covariance(take.first_frame + f, take.names[static_cast<size_t>(marker)]);
      Matrix3d turn;  // world to y up
      turn << 0, 1, 0, 0, 0, 1, 1, 0, 0;
      covariances.push_back(c ? std::optional<Matrix3d>(turn * *c * turn.transpose()) : std::nullopt);
    }
    const std::vector<double> variances = Variances(positions, covariances, has_up);
    for (size_t a = 0; a < raw.rad.size(); ++a) {
      if (raw.status[a] == AngleStatus::kOk && RadToDeg(std::sqrt(variances[a])) > kMostSigmaDeg)
        raw.status[a] = AngleStatus::kUncertain;
    }
    continuity.Follow(&raw);
    for (size_t a = 0; a < raw.rad.size(); ++a) {
      const bool ok = raw.status[a] == AngleStatus::kOk;
      angles.angles.push_back(
          {ok ? RadToDeg(raw.rad[a]) : std::nan(""), ok ? RadToDeg(std::sqrt(variances[a])) : std::nan(""), raw.status[a]});
    }
  }
  return angles;
}

}  // namespace mvstudio::markers
