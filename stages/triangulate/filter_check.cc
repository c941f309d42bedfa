#include "stages/triangulate/filter_check.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "core/parallel.h"
#include "stages/input/take_frames.h"

namespace mvstudio::stages {
namespace {

using triangulate::LeftOutSample;
using triangulate::Observation;
using triangulate::PreparedRig;
using triangulate::TakeResult;

using Key = std::tuple<int, int, std::string>;  // frame, person, joint

std::vector<int> CamerasWithSamples(const PreparedRig& rig, const TakeResult& take, int max_cameras) {
  std::vector<int> samples(rig.cameras.size(), 0), all, chosen;
  for (const auto& seen : take.observations) {
    for (size_t i = 0; i < seen.size(); ++i) samples[static_cast<size_t>(seen[i].camera_idx)] += IsLeftOutSample(rig, seen, i);
  }
  for (size_t c = 0; c < samples.size(); ++c) {
    if (samples[c] > 0) all.push_back(static_cast<int>(c));
  }
  const size_t count = std::min(all.size(), static_cast<size_t>(std::max(0, max_cameras)));
  for (size_t k = 0; k < count; ++k) chosen.push_back(all[k * all.size() / count]);
  return chosen;
}

TakeResult WithoutCameraOf(const PreparedRig& rig, const TakeResult& take, const triangulate::PointSolver& solve, int camera,
                           int num_threads) {
  TakeResult without = take;
  ParallelFor(static_cast<int64_t>(take.points.size()), num_threads, [&](int64_t i) {
    const auto at = static_cast<size_t>(i);
    without.points[at].point = solve(WithoutCamera(rig, take.observations[at], camera));
  });
  return without;
}

std::map<Key, Eigen::Vector3d> Filtered(const TakeResult& take, const geometry::Skeleton& skeleton,
                                        const MarkerOptions& options) {
  std::map<Key, Eigen::Vector3d> positions;
  const dataset::Pose3d pose = ToPose3d(take, skeleton);
  for (const markers::MarkerTake& before : markers::MarkersOf(pose, options.rate_hz)) {
    const markers::MarkerTake after = FilledAndFiltered(before, options).after;
    for (int f = 0; f < after.num_frames(); ++f) {
      for (int m = 0; m < after.num_markers(); ++m) {
        const Eigen::Vector3d& x = after.x_in_world[after.Index(f, m)];
        if (x.allFinite()) positions[{after.first_frame + f, after.person, after.names[static_cast<size_t>(m)]}] = x;
      }
    }
  }
  return positions;
}

/// What the left-out camera saw, before and after, in the same order.
struct Pair {
  std::vector<LeftOutSample> before, after;
};

void Predict(const PreparedRig& rig, const TakeResult& take, const TakeResult& without,
             const std::map<Key, Eigen::Vector3d>& filtered, const geometry::Skeleton& skeleton, int camera, Pair* pair) {
  for (size_t i = 0; i < take.points.size(); ++i) {
    const triangulate::TakePoint& at = take.points[i];
    triangulate::Point smooth = without.points[i].point;
    const auto found = filtered.find({at.frame, at.person, skeleton.joints[static_cast<size_t>(at.joint_idx)]});
    if (found != filtered.end()) smooth.x_in_world = found->second, smooth.status = Status::kOk;
    const auto& seen = take.observations[i];
    for (size_t o = 0; o < seen.size(); ++o) {
      if (seen[o].camera_idx != camera || !IsLeftOutSample(rig, seen, o)) continue;
      pair->before.push_back(PredictLeftOut(rig, seen[o], without.points[i].point, i));
      pair->after.push_back(PredictLeftOut(rig, seen[o], smooth, i));
    }
  }
}

}  // namespace

bool FilterCheck::Hurts() const {
  constexpr double kLeastErrors = 2, kLeastShare = 0.02;
  const auto worse = [&](double by_px, double error_px, double before_px) {
    return by_px > std::max(kLeastErrors * error_px, kLeastShare * before_px);
  };
  return difference.num_samples > 0 && (worse(difference.median_px, difference.median_error_px, before.median_px) ||
                                        worse(difference.p90_px, difference.p90_error_px, before.p90_px));
}

FilterCheck CheckFilter(const PreparedRig& rig, const TakeResult& take, const triangulate::PointSolver& solve,
                        const geometry::Skeleton& skeleton, const MarkerOptions& options, const RunContext& run,
                        int max_cameras) {
  FilterCheck check;
  Pair pair;
  for (const int camera : CamerasWithSamples(rig, take, max_cameras)) {
    const TakeResult without = WithoutCameraOf(rig, take, solve, camera, run.num_threads);
    Predict(rig, take, without, Filtered(without, skeleton, options), skeleton, camera, &pair);
    ++check.num_cameras;
  }
  std::vector<triangulate::PointLabel> labels;
  for (const triangulate::TakePoint& at : take.points) labels.push_back({at.frame, at.person, at.joint_idx});
  check.before = SummarizeLeftOut(rig, pair.before, labels).all;
  check.after = SummarizeLeftOut(rig, pair.after, labels).all;
  check.difference = CompareLeftOut(pair.before, pair.after, labels);
  return check;
}

}  // namespace mvstudio::stages
