#include "triangulate/sync/pair_curves.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::triangulate::internal {
namespace {

constexpr double kTruncationOfDiagonal = 0.015;
constexpr int kMinJoints = 3;

struct JointRay {
  int joint_idx;
  Eigen::Vector3d ray_in_local;
};
using PersonRays = std::vector<JointRay>;  // by joint_idx

/// Frame number -> people with at least kMinJoints rays.
using CameraRays = std::map<int, std::vector<PersonRays>>;

std::vector<CameraRays> MakeRays(const PreparedRig& rig, const std::vector<DetectedFrame>& frames, double min_score) {
  std::vector<CameraRays> rays(rig.cameras.size());
  for (const DetectedFrame& frame : frames) {
    for (size_t c = 0; c < frame.people.size(); ++c) {
      for (const DetectedPerson& person : frame.people[c]) {
        PersonRays of_person;
        for (size_t j = 0; j < person.size(); ++j) {
          if (!(person[j].score > 0) || person[j].score < min_score || !person[j].px.allFinite()) continue;
          const auto ray = rig.cameras[c].projector.Unproject(person[j].px);
          if (ray.status != Status::kOk) continue;
          of_person.push_back({static_cast<int>(j), rig.cameras[c].cam_from_local_rotation.transpose() * ray.ray_in_cam});
        }
        if (of_person.size() >= kMinJoints) rays[c][frame.frame].push_back(std::move(of_person));
      }
    }
  }
  return rays;
}

struct PairGeometry {
  Eigen::Vector3d b_minus_a;        // of the centres, metres
  double sigma_a_rad, sigma_b_rad;  // of one pixel

  /// Signed Sampson distance in px.
  double Distance(const Eigen::Vector3d& ray_a, const Eigen::Vector3d& ray_b) const {
    const Eigen::Vector3d by_a = ray_b.cross(b_minus_a), by_b = b_minus_a.cross(ray_a);
    const double e = ray_a.dot(by_a);
    const double variance =
        (by_a.squaredNorm() - e * e) * sigma_a_rad * sigma_a_rad + (by_b.squaredNorm() - e * e) * sigma_b_rad * sigma_b_rad;
    return variance > 0 ? e / std::sqrt(variance) : 0;
  }
};

void Distances(const PairGeometry& geometry, const PersonRays& a, const PersonRays& b, std::vector<double>* distances) {
  distances->clear();
  for (size_t i = 0, k = 0; i < a.size() && k < b.size();) {
    if (a[i].joint_idx == b[k].joint_idx) distances->push_back(geometry.Distance(a[i].ray_in_local, b[k].ray_in_local));
    const int ja = a[i].joint_idx, jb = b[k].joint_idx;
    i += ja <= jb, k += jb <= ja;
  }
}

/// Distances of the joints of `a` to those of the person of `people` that fits it best; empty when none has enough in common.
void BestMatch(const PairGeometry& geometry, const PersonRays& a, const std::vector<PersonRays>& people,
               std::vector<double>* best, std::vector<double>* scratch) {
  best->clear();
  double best_error = 0;
  std::vector<double> absolute;
  for (const PersonRays& b : people) {
    Distances(geometry, a, b, scratch);
    if (scratch->size() < kMinJoints) continue;
    if (people.size() == 1) {
      best->swap(*scratch);
      return;
    }
    absolute.clear();
    for (const double e : *scratch) absolute.push_back(std::abs(e));
    const double error = UpperMedian(absolute.begin(), absolute.end());
    if (!best->empty() && error >= best_error) continue;
    best_error = error;
    *best = *scratch;
  }
}

struct PairInput {
  PairGeometry geometry;
  const CameraRays* a;
  const CameraRays* b;
  std::vector<std::pair<int, int>> frames;  // sampled frames of a, block of each
  double truncation_px;
};

/// One offset. Returns the number of frames in common.
int FillEntry(const PairInput& pair, int d, PairCurve::Entry* entry) {
  std::vector<double> all, of_person, scratch;
  std::vector<int> blocks;
  int num_frames = 0;
  for (const auto& [frame, block] : pair.frames) {
    const auto other = pair.b->find(frame + d);
    if (other == pair.b->end()) continue;
    bool any = false;
    for (const PersonRays& person : pair.a->at(frame)) {
      BestMatch(pair.geometry, person, other->second, &of_person, &scratch);
      any |= !of_person.empty();
      for (const double e : of_person) all.push_back(e), blocks.push_back(block);
    }
    num_frames += any;
  }
  if (all.empty()) return 0;
  const double median = std::clamp(UpperMedian(all), -pair.truncation_px, pair.truncation_px);
  for (size_t i = 0; i < all.size(); ++i) {
    entry->sum[blocks[i]] += std::min(std::abs(all[i] - median), pair.truncation_px);
    ++entry->num[blocks[i]];
  }
  return num_frames;
}

double Diagonal(const PreparedCamera& camera) {
  return std::hypot(camera.projector.camera().width_px, camera.projector.camera().height_px);
}

void FillCurve(const PairInput& pair, const SyncOptions& options, int stride, PairCurve* curve) {
  const int n = options.max_offset_frames;
  curve->first = -n;
  curve->entries.resize(static_cast<size_t>(2 * n + 1));
  std::vector<int> common;
  for (int d = -n; d <= n; ++d) common.push_back(FillEntry(pair, d, &curve->entries[static_cast<size_t>(d + n)]) * stride);
  const double most = *std::max_element(common.begin(), common.end());
  std::vector<double> costs;
  curve->typical = 1;
  for (size_t i = 0; i < common.size(); ++i) {
    curve->entries[i].admissible = common[i] >= std::max<double>(options.min_frames, options.min_overlap * most);
    if (curve->entries[i].admissible) costs.push_back(curve->Cost(static_cast<int>(i) - n));
  }
  curve->typical = UpperMedian(costs, 0);
}

PairInput MakePair(const PreparedRig& rig, const std::vector<CameraRays>& rays, const PairCurve& curve, int stride) {
  const PreparedCamera &a = rig.cameras[static_cast<size_t>(curve.a)], &b = rig.cameras[static_cast<size_t>(curve.b)];
  PairInput pair{{b.center_in_local - a.center_in_local, 1 / a.focal_px, 1 / b.focal_px},
                 &rays[static_cast<size_t>(curve.a)],
                 &rays[static_cast<size_t>(curve.b)],
                 {},
                 0.5 * kTruncationOfDiagonal * (Diagonal(a) + Diagonal(b))};
  const int64_t count = static_cast<int64_t>(pair.a->size());
  int64_t index = 0;
  for (const auto& [frame, people] : *pair.a) {
    if (index % stride == 0) pair.frames.emplace_back(frame, static_cast<int>(index * kSyncBlocks / count));
    ++index;
  }
  return pair;
}

/// Every n-th frame, so that long takes and many cameras stay affordable.
int Stride(const std::vector<CameraRays>& rays, size_t num_pairs, const SyncOptions& options, int64_t max_evaluations) {
  int64_t persons = 0, cameras = 0;
  for (const CameraRays& camera : rays) {
    for (const auto& [frame, people] : camera) persons += static_cast<int64_t>(people.size() * people.size());
    cameras += !camera.empty();
  }
  constexpr int64_t kJoints = 20;
  const int64_t evaluations =
      persons / std::max<int64_t>(1, cameras) * kJoints * static_cast<int64_t>(num_pairs) * (2 * options.max_offset_frames + 1);
  return static_cast<int>(1 + evaluations / max_evaluations);
}

}  // namespace

double PairCurve::Cost(int d, const int* block_weights) const {
  const int64_t index = static_cast<int64_t>(d) - first;
  if (index < 0 || index >= static_cast<int64_t>(entries.size())) return 1;
  const Entry& entry = entries[static_cast<size_t>(index)];
  if (!entry.admissible) return 1;
  double sum = 0, num = 0;
  for (int k = 0; k < kSyncBlocks; ++k) {
    const double weight = block_weights ? block_weights[k] : 1;
    sum += weight * entry.sum[k], num += weight * entry.num[k];
  }
  return num > 0 ? sum / num / typical : 1;
}

int PairCurve::Best() const {
  int best = 0;
  double best_cost = 2;
  for (size_t i = 0; i < entries.size(); ++i) {
    const int d = first + static_cast<int>(i);
    const double cost = entries[i].admissible ? Cost(d) : 2;
    if (cost < best_cost) best_cost = cost, best = d;
  }
  return best;
}

std::vector<PairCurve> ComputePairCurves(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                                         const SyncOptions& options, const RunContext& run, int64_t max_evaluations) {
  const std::vector<CameraRays> rays = MakeRays(rig, frames, options.min_score);
  std::vector<PairCurve> curves;
  for (size_t a = 0; a < rays.size(); ++a) {
    for (size_t b = a + 1; b < rays.size(); ++b) {
      const bool one_centre = (rig.cameras[a].center_in_local - rig.cameras[b].center_in_local).norm() < 1e-9;
      if (rays[a].empty() || rays[b].empty() || one_centre) continue;
      curves.emplace_back();
      curves.back().a = static_cast<int>(a), curves.back().b = static_cast<int>(b);
    }
  }
  const int stride = Stride(rays, curves.size(), options, max_evaluations);
  ParallelFor(static_cast<int64_t>(curves.size()), run.num_threads, [&](int64_t i) {
    PairCurve& curve = curves[static_cast<size_t>(i)];
    FillCurve(MakePair(rig, rays, curve, stride), options, stride, &curve);
  });
  return curves;
}

}  // namespace mvstudio::triangulate::internal
