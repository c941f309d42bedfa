#include "triangulate/limbs.h"

#include <cmath>
#include <limits>
#include <map>

namespace mvstudio::triangulate {
namespace {

using Joints = std::map<int, Eigen::Vector3d>;  // joint index -> position

LimbLength Measure(int person, int limb, const std::vector<double>& lengths_m) {
  const double n = static_cast<double>(lengths_m.size());
  double sum = 0, squares = 0;
  for (const double length : lengths_m) sum += length;
  for (const double length : lengths_m) squares += (length - sum / n) * (length - sum / n);
  return {person, limb, static_cast<int>(lengths_m.size()), sum / n, std::sqrt(squares / n)};
}

}  // namespace

std::vector<LimbLength> MeasureLimbs(const std::vector<TakePoint>& points, const std::vector<std::pair<int, int>>& limbs) {
  std::map<std::pair<int, int>, Joints> skeletons;  // (person, frame)
  for (const TakePoint& entry : points) {
    if (entry.point.status == Status::kOk) skeletons[{entry.person, entry.frame}][entry.joint_idx] = entry.point.x_in_world;
  }
  std::map<std::pair<int, int>, std::vector<double>> lengths_m;  // (person, limb)
  for (const auto& [who, joints] : skeletons) {
    for (size_t k = 0; k < limbs.size(); ++k) {
      const auto a = joints.find(limbs[k].first), b = joints.find(limbs[k].second);
      if (a == joints.end() || b == joints.end()) continue;
      lengths_m[{who.first, static_cast<int>(k)}].push_back((a->second - b->second).norm());
    }
  }
  std::vector<LimbLength> measured;
  for (const auto& [key, values] : lengths_m) {
    if (values.size() >= 2) measured.push_back(Measure(key.first, key.second, values));
  }
  return measured;
}

double MeanLimbStd(const std::vector<LimbLength>& lengths) {
  double sum = 0;
  for (const LimbLength& length : lengths) sum += length.std_m;
  return lengths.empty() ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(lengths.size());
}

}  // namespace mvstudio::triangulate
