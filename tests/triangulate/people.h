#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/random.h"
#include "core/units.h"
#include "geometry/rig/rig.h"
#include "tests/triangulate/support.h"
#include "triangulate/people/association.h"

/// Synthetic people with BODY_25's joints, and what detectors make of them.
namespace mvstudio::triangulate {

struct Walker {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  // metres, on the floor z = 0
  double heading = 0, phase = 0;                       // radians
  double scale = 1;                                    // 1: 1.7 m tall
  double arm_left = 0.3, arm_right = 0.3;              // radians from hanging
};

/// The 25 joints of a walker, metres in world.
inline std::vector<Eigen::Vector3d> JointsOf(const Walker& w) {
  const double s = w.scale, swing = 0.35 * std::sin(w.phase);
  const auto at = [&](double forward, double left, double up) {
    const double c = std::cos(w.heading), n = std::sin(w.heading);
    return Eigen::Vector3d(w.position.x() + s * (c * forward - n * left), w.position.y() + s * (n * forward + c * left),
                           s * up);
  };
  std::vector<Eigen::Vector3d> j(25);
  j[0] = at(0.12, 0, 1.58), j[1] = at(0, 0, 1.42), j[8] = at(0, 0, 0.95);
  j[15] = at(0.1, -0.03, 1.62), j[16] = at(0.1, 0.03, 1.62), j[17] = at(0.02, -0.08, 1.6), j[18] = at(0.02, 0.08, 1.6);
  for (const double side : {1.0, -1.0}) {
    const bool is_left = side > 0;
    const double arm = is_left ? w.arm_left : w.arm_right, leg = side * swing;
    const int shoulder = is_left ? 5 : 2, hip = is_left ? 12 : 9, toe = is_left ? 19 : 22;
    j[shoulder] = at(0, 0.19 * side, 1.42);
    j[shoulder + 1] = at(0.28 * std::sin(arm), (0.19 + 0.05) * side, 1.42 - 0.28 * std::cos(arm));
    j[shoulder + 2] = at(0.28 * std::sin(arm) + 0.25 * std::sin(1.6 * arm), 0.24 * side,
                         1.42 - 0.28 * std::cos(arm) - 0.25 * std::cos(1.6 * arm));
    j[hip] = at(0, 0.1 * side, 0.93);
    j[hip + 1] = at(0.42 * std::sin(leg), 0.1 * side, 0.93 - 0.42 * std::cos(leg));
    j[hip + 2] = at(0.8 * std::sin(leg), 0.1 * side, 0.93 - 0.82 * std::cos(leg));
    j[toe] = j[hip + 2] + at(0.18, 0, 0) - at(0, 0, 0) + Eigen::Vector3d(0, 0, -0.06);
    j[toe + 1] = j[hip + 2] + at(0.15, 0.06 * side, 0) - at(0, 0, 0) + Eigen::Vector3d(0, 0, -0.06);
    j[toe + 2] = j[hip + 2] + at(-0.06, 0, 0) - at(0, 0, 0) + Eigen::Vector3d(0, 0, -0.05);
  }
  return j;
}

inline const std::vector<std::pair<int, int>>& WalkerMirror() {
  static const std::vector<std::pair<int, int>> pairs = {{5, 2},   {6, 3},   {7, 4},   {12, 9},  {13, 10}, {14, 11},
                                                         {16, 15}, {18, 17}, {19, 22}, {20, 23}, {21, 24}};
  return pairs;
}

struct DetectorOptions {
  double noise_px = 3;
  double outlier_joints = 0.03;  // fraction, 40 px off
  double missing_joints = 0.1;
  double missing_people = 0.1;
  double occlusion = 0.8;      // chance that a joint behind another body is not seen
  double false_people = 0.15;  // a camera and frame: a displaced copy of a person
};

/// Detections with the true person of each: truth[camera][detection], -1 for false ones.
struct SeenPeople {
  DetectedFrame frame;
  std::vector<std::vector<int>> truth;
};

inline bool IsHidden(const std::vector<Walker>& walkers, size_t own, const Eigen::Vector3d& center, const Eigen::Vector3d& x) {
  for (size_t i = 0; i < walkers.size(); ++i) {
    if (i == own) continue;
    const Eigen::Vector2d to_x = (x - center).head<2>(), to_other = walkers[i].position - center.head<2>();
    const double along = to_other.dot(to_x.normalized());
    if (along < to_x.norm() - 0.15 && (to_other - along * to_x.normalized()).norm() < 0.2) return true;
  }
  return false;
}

inline SeenPeople Detect(const geometry::Rig& rig, const std::vector<Walker>& walkers, int frame, const DetectorOptions& o,
                         Rng* rng) {
  SeenPeople seen;
  seen.frame.frame = frame;
  for (const geometry::RigCamera& camera : rig.cameras) {
    auto& people = seen.frame.people.emplace_back();
    auto& truth = seen.truth.emplace_back();
    for (size_t i = 0; i < walkers.size(); ++i) {
      DetectedPerson person;
      int visible = 0;
      for (const Eigen::Vector3d& x : JointsOf(walkers[i])) {
        Keypoint& key = person.emplace_back();
        const auto projection = geometry::Project(camera.camera, camera.cam_from_world * x);
        const bool hidden = IsHidden(walkers, i, camera.CenterInWorld(), x) && rng->Uniform() < o.occlusion;
        const bool missing = rng->Uniform() < o.missing_joints;
        const double noise = rng->Uniform() < o.outlier_joints ? 40 : o.noise_px;
        const Eigen::Vector2d offset(noise * rng->Normal(), noise * rng->Normal());
        if (projection.status != Status::kOk || hidden || missing) continue;
        key = {projection.px + offset, rng->Uniform(0.5, 1)};
        ++visible;
      }
      if (rng->Uniform() < o.missing_people || visible < 6) continue;
      people.push_back(std::move(person)), truth.push_back(static_cast<int>(i));
    }
    if (rng->Uniform() < o.false_people && !people.empty()) {
      DetectedPerson ghost = people[static_cast<size_t>(rng->Index(static_cast<int64_t>(people.size())))];
      const Eigen::Vector2d shift(rng->Uniform(-400, 400), rng->Uniform(-150, 150));
      for (Keypoint& key : ghost) key.px += shift;
      people.push_back(ghost), truth.push_back(-1);
    }
    // The order of detections tells nothing.
    for (size_t i = people.size(); i > 1; --i) {
      const size_t k = static_cast<size_t>(rng->Index(static_cast<int64_t>(i)));
      std::swap(people[i - 1], people[k]), std::swap(truth[i - 1], truth[k]);
    }
  }
  return seen;
}

/// Walkers at random places of a square, at least `min_distance_m` apart.
inline std::vector<Walker> RandomWalkers(int count, double half_size_m, double min_distance_m, Rng* rng) {
  std::vector<Walker> walkers;
  while (static_cast<int>(walkers.size()) < count) {
    Walker w;
    w.position = {rng->Uniform(-half_size_m, half_size_m), rng->Uniform(-half_size_m, half_size_m)};
    w.heading = rng->Uniform(0, 2 * kPi), w.phase = rng->Uniform(0, 2 * kPi), w.scale = rng->Uniform(0.92, 1.1);
    w.arm_left = rng->Uniform(-0.5, 1.5), w.arm_right = rng->Uniform(-0.5, 1.5);
    const bool free = std::all_of(walkers.begin(), walkers.end(),
                                  [&](const Walker& other) { return (other.position - w.position).norm() >= min_distance_m; });
    if (free) walkers.push_back(w);
  }
  return walkers;
}

/// Pairs of detections of two cameras: put together rightly, wrongly, or not at all; and people whose detections are exactly
/// those of one cluster.
struct PairScore {
  int right = 0, wrong = 0, missed = 0, people = 0, perfect = 0;
  double Precision() const { return right / std::max(1.0, static_cast<double>(right + wrong)); }
  double Recall() const { return right / std::max(1.0, static_cast<double>(right + missed)); }
  double Perfect() const { return perfect / std::max(1.0, static_cast<double>(people)); }
};

inline void Score(const SeenPeople& seen, const std::vector<Cluster>& clusters, int num_people, PairScore* score) {
  std::vector<std::vector<int>> label(seen.truth.size());
  for (size_t c = 0; c < label.size(); ++c) label[c].assign(seen.truth[c].size(), -1);
  for (size_t k = 0; k < clusters.size(); ++k) {
    for (size_t c = 0; c < label.size(); ++c) {
      if (clusters[k].choice[c] >= 0) label[c][clusters[k].choice[c]] = static_cast<int>(k);
    }
  }
  for (size_t a = 0; a < label.size(); ++a) {
    for (size_t b = a + 1; b < label.size(); ++b) {
      for (size_t i = 0; i < label[a].size(); ++i) {
        for (size_t j = 0; j < label[b].size(); ++j) {
          const bool same = seen.truth[a][i] >= 0 && seen.truth[a][i] == seen.truth[b][j];
          const bool together = label[a][i] >= 0 && label[a][i] == label[b][j];
          score->right += same && together, score->wrong += !same && together, score->missed += same && !together;
        }
      }
    }
  }
  for (int i = 0; i < num_people; ++i) {
    std::vector<int> own(label.size(), -1);
    for (size_t c = 0; c < label.size(); ++c) {
      const auto it = std::find(seen.truth[c].begin(), seen.truth[c].end(), i);
      if (it != seen.truth[c].end()) own[c] = static_cast<int>(it - seen.truth[c].begin());
    }
    if (std::count_if(own.begin(), own.end(), [](int p) { return p >= 0; }) < 2) continue;
    ++score->people;
    score->perfect +=
        std::any_of(clusters.begin(), clusters.end(), [&](const Cluster& cluster) { return cluster.choice == own; });
  }
}

}  // namespace mvstudio::triangulate
