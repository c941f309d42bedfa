#include "avatar/body/mannequin_shape.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace mvstudio::body {
namespace {

constexpr double kBlend = 0.011;      // m, radius of the smooth union
constexpr double kFloorClip = 0.002;  // m, soles are flat here
constexpr double kFar = 0.09;         // m, beyond which a tube cannot matter

Eigen::Vector3d Mirror(const Eigen::Vector3d& x) { return {-x[0], x[1], x[2]}; }

/// Cubic Hermite through the sections, finite-difference tangents.
Tube::Section At(const std::vector<Tube::Section>& s, double t) {
  size_t i = 0;
  while (i + 2 < s.size() && t > s[i + 1].t) ++i;
  const double h = s[i + 1].t - s[i].t, w = std::clamp((t - s[i].t) / h, 0.0, 1.0);
  auto slope = [&](size_t j, double Tube::Section::*field) {
    const size_t lo = j > 0 ? j - 1 : 0, hi = std::min(j + 1, s.size() - 1);
    return (s[hi].*field - s[lo].*field) / (s[hi].t - s[lo].t);
  };
  auto value = [&](double Tube::Section::*field) {
    const double w2 = w * w, w3 = w2 * w;
    return s[i].*field * (2 * w3 - 3 * w2 + 1) + s[i + 1].*field * (3 * w2 - 2 * w3) +
           h * (slope(i, field) * (w3 - 2 * w2 + w) + slope(i + 1, field) * (w3 - w2));
  };
  return {t, value(&Tube::Section::rx), value(&Tube::Section::ry), value(&Tube::Section::shift)};
}

/// A left-side tube and its mirror image.
void AddPair(const Tube& left, Region right_region, std::vector<Tube>* tubes) {
  Tube right = left;
  right.region = right_region;
  right.begin = Mirror(left.begin), right.end = Mirror(left.end), right.x_dir = -Mirror(left.x_dir);
  tubes->push_back(left);
  tubes->push_back(right);
}

void AddTrunk(std::vector<Tube>* tubes) {
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  tubes->push_back({kTorso,
                    {0, 0, 0.86},
                    {0, 0, 1.40},
                    x,
                    {{0, 0.152, 0.106, 0.010},
                     {0.13, 0.169, 0.118, 0.010},
                     {0.30, 0.162, 0.113, -0.002},
                     {0.48, 0.150, 0.107, -0.008},
                     {0.70, 0.162, 0.117, -0.006},
                     {0.87, 0.168, 0.116, 0.001},
                     {1, 0.136, 0.088, 0.010}},
                    0.05,
                    0.05});
  tubes->push_back(
      {kTorso, {0, 0.006, 1.405}, {0, 0.012, 1.475}, x, {{0, 0.082, 0.066, 0}, {1, 0.060, 0.056, 0}}, 0.03, 0.012});
  AddPair({kTorso,
           {0.04, 0.006, 1.400},
           {0.160, 0.010, 1.392},
           Eigen::Vector3d::UnitY(),
           {{0, 0.064, 0.058, 0}, {1, 0.062, 0.056, 0}},
           0.04,
           0.03},
          kTorso, tubes);
  AddPair({kTorso,
           {0.01, 0.016, 1.465},
           {0.145, 0.012, 1.420},
           Eigen::Vector3d::UnitY(),
           {{0, 0.042, 0.034, 0}, {1, 0.036, 0.028, 0}},
           0.02,
           0.02},
          kTorso, tubes);
  tubes->push_back({kHead, {0, 0.016, 1.40}, {0, 0.004, 1.55}, x, {{0, 0.056, 0.056, 0}, {1, 0.053, 0.057, 0}}, 0.02, 0.02});
  tubes->push_back(
      {kHead, {0, 0.002, 1.585}, {0, 0.006, 1.655}, x, {{0, 0.069, 0.095, 0}, {1, 0.079, 0.103, 0}}, 0.072, 0.096});
  tubes->push_back(
      {kHead, {0, -0.032, 1.560}, {0, -0.046, 1.545}, x, {{0, 0.050, 0.040, 0}, {1, 0.040, 0.036, 0}}, 0.03, 0.02});
  tubes->push_back(
      {kHead, {0, -0.084, 1.636}, {0, -0.100, 1.597}, x, {{0, 0.010, 0.010, 0}, {1, 0.015, 0.013, 0}}, 0.012, 0.009});
  AddPair({kHead, {0.066, 0.004, 1.592}, {0.068, 0.010, 1.632}, x, {{0, 0.011, 0.017, 0}, {1, 0.013, 0.022, 0}}, 0.014, 0.014},
          kHead, tubes);
}

void AddArms(const MannequinJoints& j, std::vector<Tube>* tubes) {
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  AddPair({kUpperArmL,
           j.shoulder,
           j.elbow,
           y,
           {{0, 0.060, 0.058, 0}, {0.35, 0.056, 0.053, 0}, {0.75, 0.049, 0.047, 0}, {1, 0.046, 0.044, 0}},
           0.045,
           0.03},
          kUpperArmR, tubes);
  AddPair({kForearmL,
           j.elbow,
           j.wrist,
           y,
           {{0, 0.043, 0.041, 0}, {0.28, 0.044, 0.040, 0}, {0.75, 0.035, 0.031, 0}, {1, 0.032, 0.027, 0}},
           0.03,
           0.015},
          kForearmR, tubes);
  const Eigen::Vector3d along = (j.hand_tip - j.wrist).normalized();
  AddPair(
      {kHandL,
       j.wrist,
       j.hand_tip - 0.012 * along,
       y,
       {{0, 0.028, 0.022, 0}, {0.3, 0.040, 0.021, 0}, {0.55, 0.042, 0.020, 0}, {0.8, 0.037, 0.018, 0}, {1, 0.028, 0.016, 0}},
       0.02,
       0.016},
      kHandR, tubes);
  const Eigen::Vector3d thumb = j.wrist + 0.03 * along - 0.022 * y;
  AddPair({kHandL, thumb, thumb + 0.045 * along - 0.028 * y, y, {{0, 0.018, 0.017, 0}, {1, 0.015, 0.015, 0}}, 0.014, 0.014},
          kHandR, tubes);
}

void AddLegs(const MannequinJoints& j, std::vector<Tube>* tubes) {
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  AddPair({kThighL,
           j.hip - Eigen::Vector3d(0, 0, 0.02),
           j.knee,
           x,
           {{0, 0.086, 0.104, -0.012}, {0.3, 0.083, 0.097, -0.004}, {0.7, 0.072, 0.080, 0}, {1, 0.064, 0.068, 0}},
           0.04,
           0.04},
          kThighR, tubes);
  AddPair({kShinL,
           j.knee,
           j.ankle + Eigen::Vector3d(0, 0, 0.015),
           x,
           {{0, 0.064, 0.068, 0}, {0.3, 0.065, 0.071, -0.010}, {0.7, 0.060, 0.065, -0.004}, {1, 0.060, 0.067, 0}},
           0.04,
           0.012},
          kShinR, tubes);
  const Eigen::Vector3d heel(j.ankle[0] - 0.002, j.ankle[1] + 0.032, 0.046);
  AddPair({kFootL,
           heel,
           j.toe_tip,
           x,
           {{0, 0.040, 0.048, 0}, {0.3, 0.041, 0.054, 0}, {0.7, 0.051, 0.040, 0}, {1, 0.038, 0.028, 0}},
           0.032,
           0.030},
          kFootR, tubes);
}

}  // namespace

double Tube::Value(const Eigen::Vector3d& x) const {
  const Eigen::Vector3d axis = end - begin, from = x - begin;
  const double length = axis.norm();
  const Eigen::Vector3d w_dir = axis / length;
  const Eigen::Vector3d u_dir = (x_dir - w_dir * w_dir.dot(x_dir)).normalized(), v_dir = w_dir.cross(u_dir);
  const double w = from.dot(w_dir);
  const Section s = At(sections, std::clamp(w / length, 0.0, 1.0));
  const double over = w < 0 ? -w / cap_begin : (w > length ? (w - length) / cap_end : 0.0);
  const double u = from.dot(u_dir) / s.rx, v = (from.dot(v_dir) - s.shift) / s.ry;
  return (std::sqrt(u * u + v * v + over * over) - 1) * std::min(s.rx, s.ry);
}

std::vector<Tube> MannequinTubes() {
  const MannequinJoints joints;
  std::vector<Tube> tubes;
  AddTrunk(&tubes);
  AddArms(joints, &tubes);
  AddLegs(joints, &tubes);
  return tubes;
}

double ShapeValue(const std::vector<Tube>& tubes, int region, const Eigen::Vector3d& x) {
  double sum = 0;
  for (const Tube& tube : tubes) {
    if (region < 0 || tube.region == region) sum += std::exp(-std::min(tube.Value(x), 6.0) / kBlend);
  }
  const double value = sum > 0 ? -kBlend * std::log(sum) : 6.0;
  return region < 0 ? std::max(value, kFloorClip - x[2]) : value;
}

TriangleMesh MeshTubes(const std::vector<Tube>& tubes, double step_m) {
  ScalarGrid grid;
  grid.step_m = step_m;
  const int half = static_cast<int>(std::ceil(0.76 / step_m));  // nodes at x = 0: left and right alike
  grid.origin = {-half * step_m, -0.28, -0.04};
  grid.size = {2 * half + 1, static_cast<int>(0.50 / step_m) + 2, static_cast<int>(1.84 / step_m) + 2};
  std::vector<double> sums(grid.size.cast<int64_t>().prod(), 0.0);
  for (const Tube& tube : tubes) {
    double reach = kFar;
    for (const auto& s : tube.sections) reach = std::max({reach, kFar + s.rx, kFar + s.ry});
    const Eigen::Vector3d low = tube.begin.cwiseMin(tube.end).array() - reach,
                          high = tube.begin.cwiseMax(tube.end).array() + reach;
    const Eigen::Vector3i first = ((low - grid.origin) / step_m).cast<int>().cwiseMax(0);
    const Eigen::Vector3i last =
        ((high - grid.origin) / step_m).cast<int>().cwiseMin(grid.size.array().matrix() - Eigen::Vector3i::Ones());
    for (int z = first[2]; z <= last[2]; ++z) {
      for (int y = first[1]; y <= last[1]; ++y) {
        for (int x = first[0]; x <= last[0]; ++x)
          sums[grid.Index(x, y, z)] += std::exp(-tube.Value(grid.Node(x, y, z)) / kBlend);
      }
    }
  }
  grid.values.resize(sums.size());
  for (int z = 0; z < grid.size[2]; ++z) {
    for (int y = 0; y < grid.size[1]; ++y) {
      for (int x = 0; x < grid.size[0]; ++x) {
        const double sum = sums[grid.Index(x, y, z)];
        const double value = sum > 1e-12 ? -kBlend * std::log(sum) : 0.3;
        grid.values[grid.Index(x, y, z)] = static_cast<float>(std::max(value, kFloorClip - grid.Node(x, y, z)[2]));
      }
    }
  }
  TriangleMesh mesh = SurfaceNets(grid);
  ProjectOntoLevelSet([&tubes](const Eigen::Vector3d& x) { return ShapeValue(tubes, -1, x); }, 0.4 * step_m, &mesh);
  return mesh;
}

}  // namespace mvstudio::body
