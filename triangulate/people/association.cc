#include "triangulate/people/association.h"

#include <algorithm>
#include <map>

#include "core/parallel.h"
#include "triangulate/people/affinity.h"
#include "triangulate/people/assignment.h"
#include "triangulate/people/cluster.h"
#include "triangulate/people/tracks.h"

namespace mvstudio::triangulate {
namespace {

using internal::Candidate;

using Sketch = std::vector<std::optional<internal::SketchPoint>>;

Sketch MakeSketch(const std::vector<const Candidate*>& views) {
  std::vector<internal::RaySum> sums(views.front()->rays.size());
  for (const Candidate* view : views) {
    for (size_t j = 0; j < view->rays.size(); ++j) {
      if (view->is_seen[j]) sums[j].Add(*view, j, 1);
    }
  }
  Sketch sketch;
  for (const internal::RaySum& sum : sums) sketch.push_back(internal::Solve(sum));
  return sketch;
}

Candidate Mirrored(Candidate view, const std::vector<std::pair<int, int>>& mirror) {
  for (const auto& [l, r] : mirror) {
    std::swap(view.rays[l], view.rays[r]);
    std::swap(view.is_seen[l], view.is_seen[r]);
  }
  return view;
}

struct Draft {
  Cluster cluster;
  Sketch sketch;
};

/// Gives detections that are in no cluster to those that they fit mirrored, camera by camera and optimally.
void AddMirrored(const std::vector<const Candidate*>& singles, double sigma_px, const AssociationOptions& options,
                 std::vector<Draft>* drafts) {
  for (size_t first = 0; first < singles.size();) {
    size_t last = first;
    const int camera = singles[first]->camera_idx;
    while (last < singles.size() && singles[last]->camera_idx == camera) ++last;
    Eigen::MatrixXd gain =
        Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(last - first), static_cast<Eigen::Index>(drafts->size()));
    for (size_t i = first; i < last; ++i) {
      const Candidate mirrored = Mirrored(*singles[i], options.mirror);
      for (size_t k = 0; k < drafts->size(); ++k) {
        int agreeing = 0;
        if ((*drafts)[k].cluster.choice[camera] >= 0) continue;
        gain(static_cast<Eigen::Index>(i - first), static_cast<Eigen::Index>(k)) =
            internal::SketchEvidence(mirrored, (*drafts)[k].sketch, sigma_px, options, &agreeing);
      }
    }
    const std::vector<int> choice = BestAssignment(gain);
    for (size_t i = first; i < last; ++i) {
      if (choice[i - first] >= 0) (*drafts)[choice[i - first]].cluster.choice[camera] = singles[i]->person_idx;
    }
    first = last;
  }
}

Draft MakeDraft(const PreparedRig& rig, const std::vector<const Candidate*>& views, double sigma_px,
                const AssociationOptions& options) {
  Draft draft{{std::vector<int>(rig.cameras.size(), -1), {}, 0}, MakeSketch(views)};
  for (const auto& point : draft.sketch) draft.cluster.joints.push_back(point ? std::optional(point->x) : std::nullopt);
  for (const Candidate* view : views) {
    int agreeing = 0;
    internal::SketchEvidence(*view, draft.sketch, sigma_px, options, &agreeing);
    draft.cluster.choice[view->camera_idx] = view->person_idx;
    draft.cluster.support += agreeing;
  }
  return draft;
}

/// Clusters of two cameras and more, the best supported first.
std::vector<Cluster> MakeClusters(const PreparedRig& rig, const std::vector<Candidate>& candidates, double sigma_px,
                                  const AssociationOptions& options) {
  const std::vector<int> group = internal::ClusterCandidates(candidates, sigma_px, options);
  std::map<int, std::vector<const Candidate*>> members;
  for (size_t i = 0; i < candidates.size(); ++i) members[group[i]].push_back(&candidates[i]);
  std::vector<Draft> drafts;
  std::vector<const Candidate*> singles;
  for (const Candidate& each : candidates) {
    if (members[group[static_cast<size_t>(&each - candidates.data())]].size() == 1) singles.push_back(&each);
  }
  for (const auto& [number, views] : members) {
    if (views.size() > 1) drafts.push_back(MakeDraft(rig, views, sigma_px, options));
  }
  if (!options.mirror.empty()) AddMirrored(singles, sigma_px, options, &drafts);
  std::vector<Cluster> clusters;
  for (Draft& draft : drafts) clusters.push_back(std::move(draft.cluster));
  std::stable_sort(clusters.begin(), clusters.end(), [](const Cluster& a, const Cluster& b) { return a.support > b.support; });
  return clusters;
}

bool AtMostOnePersonAnywhere(const std::vector<DetectedFrame>& frames) {
  for (const DetectedFrame& frame : frames) {
    for (const auto& people : frame.people) {
      if (people.size() > 1) return false;
    }
  }
  return true;
}

std::vector<std::vector<std::vector<int>>> OnlyPerson(const std::vector<DetectedFrame>& frames, size_t num_cameras) {
  std::vector<std::vector<std::vector<int>>> assignment(frames.size());
  for (size_t f = 0; f < frames.size(); ++f) {
    std::vector<int> choice(num_cameras, -1);
    for (size_t c = 0; c < frames[f].people.size(); ++c) choice[c] = frames[f].people[c].empty() ? -1 : 0;
    assignment[f] = {choice};
  }
  return assignment;
}

/// AssociationSigma of frames evenly spread over the take.
double TakeSigma(const PreparedRig& rig, const std::vector<DetectedFrame>& frames, const AssociationOptions& options) {
  constexpr size_t kMaxFrames = 50;
  const size_t step = std::max<size_t>(1, frames.size() / kMaxFrames);
  std::vector<std::vector<Candidate>> sample;
  for (size_t f = 0; f < frames.size(); f += step) sample.push_back(internal::MakeCandidates(rig, frames[f], options));
  return internal::AssociationSigma(sample, options);
}

}  // namespace

std::vector<Cluster> AssociateFrame(const PreparedRig& rig, const DetectedFrame& frame, const AssociationOptions& options) {
  const std::vector<Candidate> candidates = internal::MakeCandidates(rig, frame, options);
  const double sigma_px = options.sigma_px > 0 ? options.sigma_px : internal::AssociationSigma({candidates}, options);
  return sigma_px > 0 ? MakeClusters(rig, candidates, sigma_px, options) : std::vector<Cluster>();
}

TakeAssociation AssociatePeople(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                                const AssociationOptions& options, const RunContext& run) {
  if (AtMostOnePersonAnywhere(frames)) return {OnlyPerson(frames, rig.cameras.size()), 0, 0, 0};
  AssociationOptions known = options;
  if (!(known.sigma_px > 0)) known.sigma_px = TakeSigma(rig, frames, options);
  std::vector<TrackFrame> clusters(frames.size());
  ParallelFor(static_cast<int64_t>(frames.size()), run.num_threads, [&](int64_t f) {
    clusters[f] = {frames[f].frame, AssociateFrame(rig, frames[f], known)};
  });
  TakeAssociation result = FollowPersons(rig, clusters, known);
  result.sigma_px = known.sigma_px;
  return result;
}

std::vector<std::vector<std::vector<int>>> AssociateTake(const PreparedRig& rig, const std::vector<DetectedFrame>& frames,
                                                         const AssociationOptions& options, const RunContext& run) {
  return AssociatePeople(rig, frames, options, run).assignment;
}

}  // namespace mvstudio::triangulate
