#include <pybind11/stl.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <string>

#include "core/error.h"
#include "core/parallel.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/rig.h"
#include "python/run.h"
#include "triangulate/batch/batch.h"
#include "triangulate/point/calibration_covariance.h"

namespace mvstudio::python {
namespace {

using triangulate::BatchOptions;
using triangulate::BatchResult;
using triangulate::PointBatch;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// `points2d` (c, n, 2) px, `sigma_px` (c, n), `seen` (c, n).
PointBatch BatchOf(const HeldRig& held, const Doubles& points2d, const Doubles& sigma_px, const py::array_t<bool>& seen) {
  const auto cameras = static_cast<py::ssize_t>(held.rig.cameras.size());
  if (points2d.ndim() != 3 || points2d.shape(0) != cameras || points2d.shape(2) != 2)
    throw UsageError("option 'points2d': expected shape (" + std::to_string(cameras) +
                     ", n, 2), a row of points for each camera of the rig, got " + ShapeText(points2d));
  const py::ssize_t n = points2d.shape(1);
  PointBatch batch = triangulate::MakeBatch(static_cast<int>(cameras), n);
  const double *px = points2d.data(), *sigma = sigma_px.data();
  const bool* is_seen = seen.data();
  for (py::ssize_t i = 0; i < cameras * n; ++i) {
    batch.x_px[i] = is_seen[i] ? px[2 * i] : kNan, batch.y_px[i] = is_seen[i] ? px[2 * i + 1] : kNan;
    batch.sigma_px[i] = sigma[i];
  }
  return batch;
}

/// The calibration's share of a point's covariance is added.
void AddCalibration(const triangulate::PreparedRig& rig, const PointBatch& batch, int64_t i, BatchResult* result) {
  if (result->StatusOf(i) != Status::kOk) return;
  const int64_t n = batch.num_points;
  std::vector<triangulate::Observation> seen;
  triangulate::Point point;
  for (int c = 0; c < batch.num_cameras; ++c) {
    if (!result->Used(c, i)) continue;
    point.used.push_back(static_cast<int>(seen.size()));
    seen.push_back({c, {batch.x_px[c * n + i], batch.y_px[c * n + i]}, batch.sigma_px[c * n + i]});
  }
  const auto at = [&](int k) -> double& { return result->covariance[static_cast<size_t>(k * n + i)]; };
  point.status = Status::kOk, point.x_in_world = {result->x[i], result->y[i], result->z[i]};
  point.covariance << at(0), at(1), at(2), at(1), at(3), at(4), at(2), at(4), at(5);
  triangulate::AddCalibrationCovariance(rig, seen, &point);
  const Eigen::Matrix3d& sum = point.covariance;
  at(0) = sum(0, 0), at(1) = sum(0, 1), at(2) = sum(0, 2), at(3) = sum(1, 1), at(4) = sum(1, 2), at(5) = sum(2, 2);
}

void AddCalibrations(const triangulate::PreparedRig& rig, const PointBatch& batch, const RunContext& run, BatchResult* result) {
  constexpr int64_t kAtOnce = 16384;
  ProgressStage stage(run, "uncertainty of the calibration", batch.num_points);
  for (int64_t begin = 0; begin < batch.num_points; begin += kAtOnce) {
    const int64_t count = std::min(kAtOnce, batch.num_points - begin);
    ParallelFor(count, run.num_threads, [&](int64_t i) { AddCalibration(rig, batch, begin + i, result); });
    stage.Advance(count);
  }
}

/// As Python has it: points first, covariances whole.
py::tuple ArraysOf(const BatchResult& result) {
  const py::ssize_t n = result.num_points, cameras = result.num_cameras;
  py::array_t<double> x(Shape{n, 3}), covariance(Shape{n, 3, 3}), rms_px(Shape{n});
  py::array_t<uint8_t> status(Shape{n});
  py::array_t<bool> used(Shape{cameras, n});
  std::copy(result.status.begin(), result.status.end(), status.mutable_data());
  std::copy(result.rms_px.begin(), result.rms_px.end(), rms_px.mutable_data());
  double *point = x.mutable_data(), *matrix = covariance.mutable_data();
  for (py::ssize_t i = 0; i < n; ++i, point += 3, matrix += 9) {
    point[0] = result.x[i], point[1] = result.y[i], point[2] = result.z[i];
    constexpr int kEntry[9] = {0, 1, 2, 1, 3, 4, 2, 4, 5};
    for (int k = 0; k < 9; ++k) matrix[k] = result.covariance[static_cast<size_t>(kEntry[k] * n + i)];
  }
  bool* is_used = used.mutable_data();
  for (py::ssize_t c = 0; c < cameras; ++c)
    for (py::ssize_t i = 0; i < n; ++i) *is_used++ = result.Used(static_cast<int>(c), i);
  return py::make_tuple(x, covariance, status, used, rms_px);
}

py::tuple Triangulate(const std::shared_ptr<HeldRig>& rig, const Doubles& points2d, const Doubles& sigma_px,
                      const py::array_t<bool, py::array::c_style | py::array::forcecast>& seen, const std::string& method,
                      int min_views, double max_residual_sigmas, double min_parallax_sigmas, double max_distance_m,
                      bool single_precision, bool calibration_covariance, const py::object& progress, int threads,
                      uint64_t seed) {
  BatchOptions options;
  const auto known = triangulate::PointMethodFromString(method);
  if (!known) throw UsageError("option 'method' " + method + ": expected robust, all-views, linear, midpoint, dlt, …");
  options.point.method = *known, options.point.min_views = min_views, options.point.seed = seed;
  options.point.max_residual_sigmas = max_residual_sigmas, options.point.min_parallax_sigmas = min_parallax_sigmas;
  options.point.max_distance_m = max_distance_m, options.single_precision = single_precision;
  const PointBatch batch = BatchOf(*rig, points2d, sigma_px, seen);
  BatchResult result;
  RunWatched({progress, threads, seed}, [&](const RunContext& run) {
    const triangulate::PreparedRig prepared = triangulate::Prepare(rig->rig);
    result = triangulate::TriangulateBatch(prepared, batch, options, run);
    if (calibration_covariance && prepared.covariance.size() > 0) AddCalibrations(prepared, batch, run, &result);
  });
  return ArraysOf(result);
}

}  // namespace

void BindTriangulate(py::module_& module) {
  py::list words;
  for (int s = 0; s <= static_cast<int>(Status::kUndefined); ++s) words.append(std::string(ToString(static_cast<Status>(s))));
  module.attr("STATUS_WORDS") = words;
  module.def("triangulate", Triangulate);
}

}  // namespace mvstudio::python
