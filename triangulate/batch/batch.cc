#include "triangulate/batch/batch.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "core/parallel.h"
#include "triangulate/batch/lanes.h"

namespace mvstudio::triangulate {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int64_t kBlock = 512;  // points that a thread takes at a time

void CheckBatch(const PreparedRig& rig, const PointBatch& batch, const BatchOptions& options) {
  MVS_CHECK(batch.num_cameras == static_cast<int>(rig.cameras.size()),
            "the batch has " << batch.num_cameras << " cameras, the rig " << rig.cameras.size());
  MVS_CHECK(batch.num_points >= 0, "a batch of " << batch.num_points << " points");
  const size_t size = static_cast<size_t>(batch.num_cameras) * static_cast<size_t>(batch.num_points);
  MVS_CHECK(batch.x_px.size() == size && batch.y_px.size() == size && batch.sigma_px.size() == size,
            "arrays of " << batch.x_px.size() << ", " << batch.y_px.size() << ", " << batch.sigma_px.size() << " numbers, not "
                         << size);
  MVS_CHECK(options.gauss_newton_steps >= 0 && options.gauss_newton_steps <= 8,
            options.gauss_newton_steps << " Gauss-Newton steps, not 0 to 8");
}

BatchResult MakeResult(const PointBatch& batch) {
  BatchResult result;
  result.num_cameras = batch.num_cameras;
  result.num_points = batch.num_points;
  const size_t n = static_cast<size_t>(batch.num_points);
  result.status.assign(n, static_cast<uint8_t>(Status::kTooFewViews));
  for (auto* values : {&result.x, &result.y, &result.z, &result.chi_squared, &result.rms_px}) values->assign(n, kNan);
  result.covariance.assign(6 * n, kNan);
  result.num_views.assign(n, 0);
  result.used.assign(static_cast<size_t>(batch.num_cameras + 63) / 64 * n, 0);
  return result;
}

/// What the cameras see of one point.
void Gather(const PointBatch& batch, int64_t point, std::vector<Observation>* observations) {
  observations->clear();
  for (int c = 0; c < batch.num_cameras; ++c) {
    const size_t at = static_cast<size_t>(c * batch.num_points + point);
    if (std::isnan(batch.x_px[at]) || std::isnan(batch.y_px[at])) continue;
    observations->push_back({c, {batch.x_px[at], batch.y_px[at]}, batch.sigma_px[at], 1.0});
  }
}

void SolveOneByOne(const PreparedRig& rig, const PointBatch& batch, const BatchOptions& options, int64_t first, int64_t count,
                   const uint8_t* done, BatchResult* result) {
  std::vector<Observation> observations;
  PointOptions own = options.point;
  for (int64_t i = first; i < first + count; ++i) {
    if (done[i - first]) continue;
    Gather(batch, i, &observations);
    own.seed = options.point.seed + static_cast<uint64_t>(options.first_point + i);
    Point point = TriangulatePoint(rig, observations, own);
    for (int& used : point.used) used = observations[used].camera_idx;
    internal::StorePoint(point, i, result);
  }
}

/// Calls `solve(first, count)` for all blocks, some of them between two reports of progress.
template <class Solve>
void ForEachBlock(int64_t num_points, const RunContext& run, const Solve& solve) {
  constexpr int64_t kBlocksAtOnce = 32;  // between looks at whether somebody cancelled: below a second for the slowest points
  const int64_t num_blocks = (num_points + kBlock - 1) / kBlock;
  ProgressStage stage(run, "triangulate", num_points);
  for (int64_t done = 0; done < num_blocks; done += kBlocksAtOnce) {
    ParallelFor(std::min(kBlocksAtOnce, num_blocks - done), run.num_threads, [&](int64_t block) {
      const int64_t first = (done + block) * kBlock;
      solve(first, std::min(kBlock, num_points - first));
    });
    stage.Advance(std::min(kBlocksAtOnce * kBlock, num_points - done * kBlock));
  }
}

template <class S>
void SolveAll(const PreparedRig& rig, const PointBatch& batch, const BatchOptions& options, const RunContext& run,
              BatchResult* result) {
  const PointMethod method = options.point.method;
  const bool in_lanes = method == PointMethod::kRobust || method == PointMethod::kAllViews || method == PointMethod::kLinear ||
                        method == PointMethod::kMidpoint;
  const bool quick = in_lanes && internal::FitsLanes(rig);
  const internal::LaneRig<S> lanes = quick ? internal::MakeLaneRig<S>(rig) : internal::LaneRig<S>{};
  ForEachBlock(batch.num_points, run, [&](int64_t first, int64_t count) {
    uint8_t done[kBlock] = {};
    if (quick) internal::SolveInLanes(lanes, rig, batch, options, first, count, result, done);
    SolveOneByOne(rig, batch, options, first, count, done, result);
  });
}

}  // namespace

void internal::StorePoint(const Point& point, int64_t i, BatchResult* result) {
  result->status[i] = static_cast<uint8_t>(point.status);
  if (point.status != Status::kOk) return;
  const int64_t n = result->num_points;
  result->x[i] = point.x_in_world.x(), result->y[i] = point.x_in_world.y(), result->z[i] = point.x_in_world.z();
  int k = 0;
  for (int row = 0; row < 3; ++row) {
    for (int col = row; col < 3; ++col) result->covariance[k++ * n + i] = point.covariance(row, col);
  }
  result->chi_squared[i] = point.chi_squared;
  result->rms_px[i] = point.rms_px;
  result->num_views[i] = static_cast<int32_t>(point.used.size());
  for (const int camera : point.used) result->used[camera / 64 * n + i] |= uint64_t{1} << (camera % 64);
}

PointBatch MakeBatch(int num_cameras, int64_t num_points) {
  const size_t size = static_cast<size_t>(num_cameras) * static_cast<size_t>(num_points);
  PointBatch batch;
  batch.num_cameras = num_cameras;
  batch.num_points = num_points;
  batch.x_px.assign(size, kNan);
  batch.y_px.assign(size, kNan);
  batch.sigma_px.assign(size, 1.0);
  return batch;
}

BatchResult TriangulateBatch(const PreparedRig& rig, const PointBatch& batch, const BatchOptions& options,
                             const RunContext& run) {
  CheckBatch(rig, batch, options);
  BatchResult result = MakeResult(batch);
  if (options.single_precision) {
    SolveAll<float>(rig, batch, options, run, &result);
  } else {
    SolveAll<double>(rig, batch, options, run, &result);
  }
  return result;
}

}  // namespace mvstudio::triangulate
