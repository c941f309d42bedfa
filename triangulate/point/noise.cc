#include "triangulate/point/noise.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::triangulate {
namespace {

using Points = std::vector<std::vector<Observation>>;

constexpr size_t kMinPoints = 5;

struct RoundResult {
  size_t num_tried = 0, num_ok = 0;
  double scale = 0;  // of the sigmas that went in
};

RoundResult EstimateRound(const PreparedRig& rig, const Points& points, const PointOptions& options, double scale,
                          int num_threads) {
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
  result.scale = std::sqrt(UpperMedian(ratios));
  return result;
}

Points Sample(const Points& points, size_t max_points) {
  std::vector<size_t> usable;
  for (size_t i = 0; i < points.size(); ++i) {
    if (points[i].size() >= 2) usable.push_back(i);
  }
  const size_t count = std::min(usable.size(), max_points);
  Points sample;
  for (size_t k = 0; k < count; ++k) sample.push_back(points[usable[k * usable.size() / count]]);
  return sample;
}

/// Repeats the estimate until the views selected under it no longer change it. 0 when there are too few points.
double Settle(const PreparedRig& rig, const Points& points, const PointOptions& options, double start_scale, int num_threads) {
  if (points.size() < kMinPoints) return 0;
  double scale = start_scale;
  for (int round = 0; round < 12; ++round) {
    const RoundResult result = EstimateRound(rig, points, options, scale, num_threads);
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

/// Median |r| of each camera over the points that can be had; -1 for cameras without any.
std::vector<double> CameraResiduals(const PreparedRig& rig, const Points& points, const PointOptions& options, double scale) {
  std::vector<std::vector<double>> residuals(rig.cameras.size());
  for (std::vector<Observation> observations : points) {
    for (Observation& observation : observations) observation.sigma_px *= scale;
    const Point point = TriangulatePoint(rig, observations, options);
    if (point.status != Status::kOk) continue;
    for (const Observation& seen : observations) {
      const PreparedCamera& camera = rig.cameras[seen.camera_idx];
      const auto projection = camera.projector.Project(camera.ToCam(point.x_in_world - rig.origin_in_world));
      if (projection.status == Status::kOk) residuals[seen.camera_idx].push_back((projection.px - seen.px).norm());
    }
  }
  std::vector<double> medians;
  for (std::vector<double>& each : residuals) medians.push_back(UpperMedian(each, -1));
  return medians;
}

Points WithoutCamera(const Points& points, int camera_idx) {
  Points rest;
  for (const std::vector<Observation>& observations : points) {
    std::vector<Observation> kept;
    std::copy_if(observations.begin(), observations.end(), std::back_inserter(kept),
                 [camera_idx](const Observation& seen) { return seen.camera_idx != camera_idx; });
    if (kept.size() >= 2) rest.push_back(std::move(kept));
  }
  return rest;
}

/// A camera whose calibration is off spoils every point and would pass as noise of all. Leaves out the camera without which the
/// scale falls to less than half, among the three with the largest residuals; false when there is none. At least 4 others must
/// stay: fewer fit each other too easily.
bool LeaveOutWorstCamera(const PreparedRig& rig, const PointOptions& options, int num_threads, Points* points, double* scale) {
  constexpr size_t kCandidates = 3, kMinRemaining = 4;
  constexpr double kWorthTrying = 0.8;  // one round at the old scale shows whether a camera matters
  const std::vector<double> residuals = CameraResiduals(rig, *points, options, *scale);
  std::vector<int> cameras;
  for (size_t c = 0; c < residuals.size(); ++c) {
    if (residuals[c] >= 0) cameras.push_back(static_cast<int>(c));
  }
  if (cameras.size() <= kMinRemaining) return false;
  std::stable_sort(cameras.begin(), cameras.end(), [&residuals](int a, int b) { return residuals[a] > residuals[b]; });
  double best_scale = 0.5 * *scale;
  Points best_points;
  for (size_t k = 0; k < std::min(kCandidates, cameras.size()); ++k) {
    Points rest = WithoutCamera(*points, cameras[k]);
    if (rest.size() < kMinPoints || EstimateRound(rig, rest, options, *scale, num_threads).scale > kWorthTrying) continue;
    const double without = Settle(rig, rest, options, *scale, num_threads);
    if (without == 0 || without >= best_scale) continue;
    best_scale = without;
    best_points = std::move(rest);
  }
  if (best_points.empty()) return false;
  *scale = best_scale;
  *points = std::move(best_points);
  return true;
}

}  // namespace

double ChiSquaredMedian(int degrees_of_freedom) {
  if (degrees_of_freedom == 1) return 0.454936;
  const double k = 0.5 * degrees_of_freedom;  // of the gamma distribution
  return 2 * (k - 1.0 / 3 + (8.0 / 405 + (184.0 / 25515 + 2248.0 / 3444525 / k) / k) / k);
}

double EstimateNoiseScale(const PreparedRig& rig, const std::vector<std::vector<Observation>>& points,
                          const PointOptions& options, double start_scale, double fallback, int num_threads, int max_points) {
  PointOptions rough = options;
  rough.method = PointMethod::kRobust;
  rough.min_parallax_sigmas = 1e-3;  // where a point is does not matter here, only how well it fits
  rough.max_distance_m = 0;
  Points sample = Sample(points, static_cast<size_t>(max_points));
  double scale = Settle(rig, sample, rough, start_scale, num_threads);
  if (scale == 0) return fallback;
  while (LeaveOutWorstCamera(rig, rough, num_threads, &sample, &scale)) {
  }
  return scale;
}

}  // namespace mvstudio::triangulate
