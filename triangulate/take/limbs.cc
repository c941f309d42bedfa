#include "triangulate/take/limbs.h"

#include <cmath>
#include <limits>
#include <map>

#include "core/statistics.h"

namespace mvstudio::triangulate {
namespace {

using Joints = std::map<int, Eigen::Vector3d>;  // joint index -> position

LimbLength Measure(int person, int limb, const std::vector<double>& lengths_m) {
  return {person, limb, static_cast<int>(lengths_m.size()), Mean(lengths_m), PopulationDeviation(lengths_m)};
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

std::vector<LimbLength> MergeLimbs(const std::vector<LimbLength>& a, const std::vector<LimbLength>& b) {
  std::map<std::pair<int, int>, LimbLength> merged;
  for (const LimbLength& length : a) merged[{length.person, length.limb}] = length;
  for (const LimbLength& length : b) {
    const auto [place, is_new] = merged.emplace(std::pair(length.person, length.limb), length);
    if (is_new) continue;
    LimbLength& sum = place->second;
    const double n = sum.num_frames, m = length.num_frames, step = length.mean_m - sum.mean_m;
    const double squares = n * sum.std_m * sum.std_m + m * length.std_m * length.std_m + step * step * n * m / (n + m);
    sum.mean_m += step * m / (n + m);
    sum.std_m = std::sqrt(squares / (n + m));
    sum.num_frames += length.num_frames;
  }
  std::vector<LimbLength> list;
  for (const auto& [key, length] : merged) list.push_back(length);
  return list;
}

double MeanLimbStd(const std::vector<LimbLength>& lengths) {
  double sum = 0;
  for (const LimbLength& length : lengths) sum += length.std_m;
  return lengths.empty() ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(lengths.size());
}

}  // namespace mvstudio::triangulate
