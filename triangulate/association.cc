#include "triangulate/association.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"
#include "triangulate/linear.h"
#include "triangulate/refine.h"
#include "triangulate/tracks.h"

namespace mvstudio::triangulate {
namespace {

using Joints = std::vector<std::optional<Eigen::Vector3d>>;

/// A detected person with the rays of its joints.
struct Candidate {
  int camera_idx, person_idx;
  std::vector<std::optional<View>> joints;
};

std::vector<Candidate> MakeCandidates(const PreparedRig& rig, const DetectedFrame& frame, const AssociationOptions& options) {
  std::vector<Candidate> candidates;
  for (size_t c = 0; c < frame.people.size(); ++c) {
    for (size_t p = 0; p < frame.people[c].size(); ++p) {
      Candidate candidate{static_cast<int>(c), static_cast<int>(p), {}};
      for (const Keypoint& key : frame.people[c][p]) {
        std::optional<View>& view = candidate.joints.emplace_back();
        if (!(key.score >= options.min_score) || !(key.score > 0)) continue;
        Status rejected;
        const auto views = MakeViews(rig, {{candidate.camera_idx, key.px, 1.0, key.score}}, &rejected);
        if (!views.empty()) view = views.front();
      }
      candidates.push_back(std::move(candidate));
    }
  }
  return candidates;
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double ErrorLimit(const Candidate& candidate, const PreparedRig& rig, const AssociationOptions& options) {
  if (options.max_error_px > 0) return options.max_error_px;
  const geometry::Camera& camera = rig.cameras[candidate.camera_idx].projector.camera();
  return 0.015 * std::hypot(camera.width_px, camera.height_px);
}

/// Median distance of a candidate's joints from a skeleton, px; infinity with too few joints in common.
double MedianError(const Candidate& candidate, const Joints& skeleton, const AssociationOptions& options, int* num_common) {
  std::vector<double> errors;
  for (size_t j = 0; j < std::min(skeleton.size(), candidate.joints.size()); ++j) {
    if (skeleton[j] && candidate.joints[j]) errors.push_back(WhitenedResidual(*candidate.joints[j], *skeleton[j]));
  }
  *num_common = static_cast<int>(errors.size());
  return *num_common < options.min_joints ? std::numeric_limits<double>::infinity() : Median(std::move(errors));
}

Joints TwoViewSkeleton(const Candidate& a, const Candidate& b) {
  Joints skeleton(std::min(a.joints.size(), b.joints.size()));
  for (size_t j = 0; j < skeleton.size(); ++j) {
    if (!a.joints[j] || !b.joints[j]) continue;
    const LinearPoint point = TwoViewMidpoint(*a.joints[j], *b.joints[j]);
    if (point.status == Status::kOk) skeleton[j] = point.x_in_local;
  }
  return skeleton;
}

/// The skeleton of all members of a cluster.
Joints ClusterSkeleton(const Cluster& cluster, const std::vector<Candidate>& candidates) {
  Joints skeleton;
  std::vector<std::vector<View>> views;
  for (const Candidate& candidate : candidates) {
    if (cluster.choice[candidate.camera_idx] != candidate.person_idx) continue;
    views.resize(std::max(views.size(), candidate.joints.size()));
    for (size_t j = 0; j < candidate.joints.size(); ++j) {
      if (candidate.joints[j]) views[j].push_back(*candidate.joints[j]);
    }
  }
  for (const std::vector<View>& each : views) {
    const LinearPoint point = Midpoint(each);
    skeleton.push_back(point.status == Status::kOk ? std::optional<Eigen::Vector3d>(point.x_in_local) : std::nullopt);
  }
  return skeleton;
}

/// What agrees with a proposed skeleton: in each camera the person nearest to it, if near enough.
Cluster Collect(const PreparedRig& rig, const std::vector<Candidate>& candidates, const Joints& skeleton,
                const AssociationOptions& options, double* total_error) {
  Cluster cluster{std::vector<int>(rig.cameras.size(), -1), skeleton, 0};
  std::vector<double> errors(rig.cameras.size(), std::numeric_limits<double>::infinity());
  std::vector<int> commons(rig.cameras.size(), 0);
  for (const Candidate& candidate : candidates) {
    int common = 0;
    const double error = MedianError(candidate, skeleton, options, &common);
    const int c = candidate.camera_idx;
    if (error > ErrorLimit(candidate, rig, options) || error >= errors[c]) continue;
    errors[c] = error, commons[c] = common, cluster.choice[c] = candidate.person_idx;
  }
  *total_error = 0;
  for (size_t c = 0; c < errors.size(); ++c) {
    cluster.support += commons[c];
    if (cluster.choice[c] >= 0) *total_error += errors[c];
  }
  return cluster;
}

std::optional<Cluster> BestCluster(const PreparedRig& rig, const std::vector<Candidate>& candidates,
                                   const AssociationOptions& options) {
  std::optional<Cluster> best;
  double best_error = 0;
  for (size_t i = 0; i < candidates.size(); ++i) {
    for (size_t j = i + 1; j < candidates.size(); ++j) {
      if (candidates[i].camera_idx == candidates[j].camera_idx) continue;
      double error = 0;
      Cluster cluster = Collect(rig, candidates, TwoViewSkeleton(candidates[i], candidates[j]), options, &error);
      const auto cameras = std::count_if(cluster.choice.begin(), cluster.choice.end(), [](int p) { return p >= 0; });
      if (cameras < 2) continue;
      if (!best || cluster.support > best->support || (cluster.support == best->support && error < best_error)) {
        best = std::move(cluster);
        best_error = error;
      }
    }
  }
  return best;
}

bool AtMostOnePersonAnywhere(const std::vector<DetectedFrame>& frames) {
  for (const DetectedFrame& frame : frames) {
    for (const auto& people : frame.people) {
      if (people.size() > 1) return false;
    }
  }
  return true;
}

}  // namespace

std::vector<Cluster> AssociateFrame(const PreparedRig& rig, const DetectedFrame& frame, const AssociationOptions& options) {
  std::vector<Candidate> candidates = MakeCandidates(rig, frame, options);
  std::vector<Cluster> clusters;
  while (auto cluster = BestCluster(rig, candidates, options)) {
    cluster->joints = ClusterSkeleton(*cluster, candidates);
    candidates.erase(std::remove_if(candidates.begin(), candidates.end(),
                                    [&](const Candidate& c) { return cluster->choice[c.camera_idx] == c.person_idx; }),
                     candidates.end());
    clusters.push_back(std::move(*cluster));
  }
  return clusters;
}

std::vector<std::vector<std::vector<int>>> AssociateTake(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                                                         const AssociationOptions& options, const RunContext& run) {
  std::vector<std::vector<std::vector<int>>> assignment(frames.size());
  if (AtMostOnePersonAnywhere(frames)) {
    for (size_t f = 0; f < frames.size(); ++f) {
      std::vector<int> choice(rig.cameras.size(), -1);
      for (size_t c = 0; c < frames[f].people.size(); ++c) choice[c] = frames[f].people[c].empty() ? -1 : 0;
      assignment[f] = {choice};
    }
    return assignment;
  }
  std::vector<TrackFrame> clusters(frames.size());
  ParallelFor(static_cast<int64_t>(frames.size()), run.num_threads, [&](int64_t f) {
    clusters[f] = {frames[f].frame, AssociateFrame(rig, frames[f], options)};
  });
  return FollowPersons(clusters, rig.cameras.size(), options);
}

}  // namespace mvstudio::triangulate
