#include "triangulate/noise.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"

namespace mvstudio::triangulate {
namespace {

constexpr size_t kMinPoints = 5;

struct RoundResult {
  size_t num_tried = 0, num_ok = 0;
  double scale = 0;  // of the sigmas that went in
};

RoundResult EstimateRound(const PreparedRig& rig, const std::vector<std::vector<Observation>>& points, const PointOptions& options,
                          double scale, int num_threads) {
  std::vector<double> ratios(points.size(), -1);
  ParallelFor(static_cast<int64_t>(points.size()), num_threads, [&](int64_t i) {
    std::vector<Observation> observations = points[i];
    for (Observation& observation : observations) observation.sigma_px *= scale;
    const Point point = TriangulatePoint(rig, observations, options);
    if (point.status != Status::kOk) return;
    ratios[i] = point.chi_squared / ChiSquaredMedian(2 * static_cast<int>(point.used.size()) - 3);
  });
  RoundResult result{points.size(), 0, 0};
  ratios.erase(std::remove_if(ratios.begin(), ratios.end(), [](double r) { return r < 0; }), ratios.end());
  result.num_ok = ratios.size();
  if (ratios.empty()) return result;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  result.scale = std::sqrt(*middle);
  return result;
}

std::vector<std::vector<Observation>> Sample(const std::vector<std::vector<Observation>>& points, size_t max_points) {
  std::vector<size_t> usable;
  for (size_t i = 0; i < points.size(); ++i) {
    if (points[i].size() >= 2) usable.push_back(i);
  }
  const size_t count = std::min(usable.size(), max_points);
  std::vector<std::vector<Observation>> sample;
  for (size_t k = 0; k < count; ++k) sample.push_back(points[usable[k * usable.size() / count]]);
  return sample;
}

}  // namespace

double ChiSquaredMedian(int degrees_of_freedom) {
  if (degrees_of_freedom == 1) return 0.454936;
  const double k = 0.5 * degrees_of_freedom;  // of the gamma distribution
  return 2 * (k - 1.0 / 3 + (8.0 / 405 + (184.0 / 25515 + 2248.0 / 3444525 / k) / k) / k);
}

double EstimateNoiseScale(const PreparedRig& rig, const std::vector<std::vector<Observation>>& points, const PointOptions& options,
                          double start_scale, double fallback, int num_threads, int max_points) {
  const std::vector<std::vector<Observation>> sample = Sample(points, static_cast<size_t>(max_points));
  PointOptions rough = options;
  rough.method = PointMethod::kRobust;
  rough.min_parallax_sigmas = 1e-3;  // where a point is does not matter here, only how well it fits
  rough.max_distance_m = 0;
  double scale = start_scale;
  for (int round = 0; round < 12; ++round) {
    const RoundResult result = EstimateRound(rig, sample, rough, scale, num_threads);
    if (result.num_tried < kMinPoints) return fallback;
    if (3 * result.num_ok < result.num_tried) {  // residuals beyond what the scale allows: a rig far off
      scale *= 2;
      continue;
    }
    const double next = std::max(scale * result.scale, 1e-9);
    const bool settled = std::abs(next - scale) < 0.01 * scale;
    scale = next;
    if (settled) break;
  }
  return scale;
}

}  // namespace mvstudio::triangulate
