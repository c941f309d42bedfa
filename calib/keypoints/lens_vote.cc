#include "calib/keypoints/lens_vote.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "calib/keypoints/profile.h"
#include "core/format.h"
#include "core/statistics.h"
#include "geometry/rig/alignment.h"

namespace mvstudio::calib {
namespace {

bool FitsWell(const KeypointFit& fit, double cauchy_px) {
  return fit.ok && std::all_of(fit.residuals_px.begin(), fit.residuals_px.end(),
                               [&](const Eigen::Vector2d& r) { return r.norm() <= kInlierScales * cauchy_px; });
}

/// Joints that both rigs explain, and their points.
struct Shared {
  std::vector<const KeypointJoint*> joints;
  Eigen::Matrix3Xd before, after;
};

Shared SharedPoints(const std::vector<KeypointFit>& before, const std::vector<KeypointFit>& after, double cauchy_px) {
  std::vector<size_t> both;
  for (size_t i = 0; i < std::min(before.size(), after.size()); ++i)
    if (FitsWell(before[i], cauchy_px) && FitsWell(after[i], cauchy_px)) both.push_back(i);
  Shared shared;
  shared.before.resize(3, static_cast<Eigen::Index>(both.size())), shared.after = shared.before;
  for (size_t k = 0; k < both.size(); ++k) {
    shared.joints.push_back(before[both[k]].joint);
    shared.before.col(static_cast<Eigen::Index>(k)) = before[both[k]].x_in_world;
    shared.after.col(static_cast<Eigen::Index>(k)) = after[both[k]].x_in_world;
  }
  return shared;
}

/// Pixels per metre of a joint's cameras, their mean.
double PxPerMetre(const geometry::Rig& rig, const KeypointJoint& joint, const Eigen::Vector3d& x_in_world) {
  double sum = 0;
  for (const triangulate::Observation& seen : joint.seen) {
    const geometry::RigCamera& camera = rig.cameras[static_cast<size_t>(seen.camera_idx)];
    sum += camera.camera.fx() / (camera.cam_from_world * x_in_world).norm() / static_cast<double>(joint.seen.size());
  }
  return sum;
}

double BendOf(const geometry::Rig& rig, const Shared& shared) {
  const geometry::Alignment alignment = geometry::AlignPoints(shared.after, shared.before, true);
  if (alignment.status != Status::kOk) return 0;
  std::vector<double> moved_px;
  for (size_t i = 0; i < shared.joints.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const Eigen::Vector3d x = shared.before.col(k), y = shared.after.col(k);
    const Eigen::Vector3d aligned = alignment.scale * (alignment.b_from_a.rotation * y) + alignment.b_from_a.translation;
    moved_px.push_back(PxPerMetre(rig, *shared.joints[i], x) * (aligned - x).norm());
  }
  return LinearQuantile(std::move(moved_px), 0.5);
}

/// Half the spread of the middle half, relative to the median: a few wrong points do not count.
double RelativeScatter(const std::vector<double>& lengths) {
  return (LinearQuantile(lengths, 0.75) - LinearQuantile(lengths, 0.25)) / (2 * LinearQuantile(lengths, 0.5));
}

/// Distances of joints of a person that stay within a tenth under the rig before: their scatter under both.
DistanceVote VoteOfDistances(const Shared& shared) {
  constexpr double kRigid = 0.05;
  constexpr size_t kFewestFrames = 10, kMostJoints = 40;
  std::map<std::pair<int, int>, std::vector<size_t>> people;  // frame, person: joints
  for (size_t i = 0; i < shared.joints.size(); ++i) people[{shared.joints[i]->frame, shared.joints[i]->person}].push_back(i);
  std::map<std::tuple<int, int, int>, std::pair<std::vector<double>, std::vector<double>>> lengths;  // person, joints
  for (const auto& [key, members] : people) {
    const size_t count = std::min(members.size(), kMostJoints);
    for (size_t a = 0; a < count; ++a) {
      for (size_t b = a + 1; b < count; ++b) {
        const auto i = static_cast<Eigen::Index>(members[a]), j = static_cast<Eigen::Index>(members[b]);
        auto& [before, after] =
            lengths[{key.second, shared.joints[members[a]]->joint_idx, shared.joints[members[b]]->joint_idx}];
        before.push_back((shared.before.col(i) - shared.before.col(j)).norm());
        after.push_back((shared.after.col(i) - shared.after.col(j)).norm());
      }
    }
  }
  std::vector<double> ratios;
  for (const auto& [pair, both] : lengths) {
    if (both.first.size() < kFewestFrames) continue;
    const double before = RelativeScatter(both.first), after = RelativeScatter(both.second);
    if (before < kRigid && before > 0) ratios.push_back(after / before);
  }
  const auto num = static_cast<int>(ratios.size());
  return {num, num > 0 ? LinearQuantile(std::move(ratios), 0.5) : 1};
}

constexpr double kBetter = 0.95;

std::string Refusal(const LensVote& vote) {
  constexpr double kWorse = 1.02, kMostBend = 3;
  if (vote.num_distances > 0 && vote.scatter_ratio > kWorse)
    return Format("distances that stay the same scatter %.0f %% more with it", 100 * (vote.scatter_ratio - 1));
  if (vote.by_distances) return "";
  if (vote.bend_px <= kMostBend * vote.gain_px) return "";
  return Format("it bends space by %.2f px to explain %.2f px: the points do not determine it", vote.bend_px, vote.gain_px);
}

}  // namespace

DistanceVote CompareDistances(const std::vector<KeypointFit>& before, const std::vector<KeypointFit>& after, double cauchy_px) {
  return VoteOfDistances(SharedPoints(before, after, cauchy_px));
}

double BendPx(const geometry::Rig& rig, const std::vector<KeypointFit>& before, const std::vector<KeypointFit>& after,
              double cauchy_px) {
  return BendOf(rig, SharedPoints(before, after, cauchy_px));
}

LensVote VoteOnLenses(const geometry::Rig& before, const std::vector<KeypointFit>& fits_before,
                      const std::vector<KeypointFit>& fits_after, double before_px, double after_px, double cauchy_px) {
  const Shared shared = SharedPoints(fits_before, fits_after, cauchy_px);
  LensVote vote;
  vote.gain_px = std::sqrt(std::max(0.0, before_px * before_px - after_px * after_px));
  if (shared.joints.size() < 10) return vote;
  vote.bend_px = BendOf(before, shared);
  const DistanceVote distances = VoteOfDistances(shared);
  vote.num_distances = distances.num, vote.scatter_ratio = distances.scatter_ratio;
  vote.by_distances = vote.num_distances > 0 && vote.scatter_ratio < kBetter;
  vote.refusal = Refusal(vote);
  return vote;
}

}  // namespace mvstudio::calib
