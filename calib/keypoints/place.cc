#include "calib/keypoints/place.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <opengv/relative_pose/CentralRelativeAdapter.hpp>
#include <opengv/sac/Ransac.hpp>
#include <opengv/sac_problems/relative_pose/CentralRelativePoseSacProblem.hpp>
#include <set>
#include <tuple>

#include "calib/points/point_resection.h"
#include "core/format.h"
#include "core/statistics.h"
#include "triangulate/point/point.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;
using triangulate::DetectedFrame;
using triangulate::DetectedPerson;

constexpr double kSigmaOfDiagonal = 0.004;  // a person detector's joints, as a share of the image's diagonal
constexpr size_t kFewestJoints = 30, kMostJoints = 600;

using Label = std::pair<int, int>;  // frame, joint

struct SeenJoint {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();
};

/// What each camera sees of the person, and the noise of it.
struct JointObservations {
  std::vector<std::map<Label, SeenJoint>> of_camera;
  std::vector<double> sigma_px, sigma_rad;
};

double ExtentOf(const DetectedPerson& person, double min_score) {
  Eigen::AlignedBox2d box;
  for (const triangulate::Keypoint& key : person) {
    if (key.score > 0 && key.score >= min_score && key.px.allFinite()) box.extend(key.px);
  }
  return box.isEmpty() ? 0 : box.diagonal().norm();
}

JointObservations NoObservations(const geometry::Rig& rig) {
  JointObservations observations;
  observations.of_camera.resize(rig.cameras.size());
  for (const geometry::RigCamera& camera : rig.cameras) {
    observations.sigma_px.push_back(kSigmaOfDiagonal * std::hypot(camera.camera.width_px, camera.camera.height_px));
    observations.sigma_rad.push_back(observations.sigma_px.back() / (0.5 * (camera.camera.fx() + camera.camera.fy())));
  }
  return observations;
}

JointObservations Collect(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, double min_score) {
  JointObservations observations = NoObservations(rig);
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const geometry::Projector projector(rig.cameras[c].camera);
    for (const DetectedFrame& frame : frames) {
      const std::vector<DetectedPerson>& people = frame.people[c];
      if (people.empty()) continue;
      const auto largest = std::max_element(people.begin(), people.end(), [&](const auto& a, const auto& b) {
        return ExtentOf(a, min_score) < ExtentOf(b, min_score);
      });
      for (size_t j = 0; j < largest->size(); ++j) {
        const triangulate::Keypoint& key = (*largest)[j];
        if (!(key.score > 0 && key.score >= min_score) || !key.px.allFinite()) continue;
        const geometry::Unprojection ray = projector.Unproject(key.px);
        if (ray.status == Status::kOk)
          observations.of_camera[c][{frame.frame, static_cast<int>(j)}] = {key.px, ray.ray_in_cam.normalized()};
      }
    }
  }
  return observations;
}

JointObservations CollectJoints(const geometry::Rig& rig, const std::vector<KeypointJoint>& joints) {
  constexpr size_t kMostObservations = 12000;
  constexpr int kMostJointsOfPerson = 10000;
  JointObservations observations = NoObservations(rig);
  std::vector<geometry::Projector> projectors;
  for (const geometry::RigCamera& camera : rig.cameras) projectors.emplace_back(camera.camera);
  for (const KeypointJoint& joint : calib::ThinnedTo(joints, kMostObservations)) {
    for (const triangulate::Observation& seen : joint.seen) {
      const auto c = static_cast<size_t>(seen.camera_idx);
      const geometry::Unprojection ray = projectors[c].Unproject(seen.px);
      if (ray.status != Status::kOk) continue;
      observations.of_camera[c][{joint.frame, joint.person * kMostJointsOfPerson + joint.joint_idx}] = {
          seen.px, ray.ray_in_cam.normalized()};
    }
  }
  return observations;
}

/// Every n-th of a list, so that at most `most` remain.
template <class Item>
std::vector<Item> ThinnedTo(const std::vector<Item>& items, size_t most) {
  if (items.size() <= most) return items;
  std::vector<Item> kept;
  for (size_t i = 0; i < most; ++i) kept.push_back(items[i * items.size() / most]);
  return kept;
}

std::vector<Label> Common(const JointObservations& observations, size_t a, size_t b) {
  std::vector<Label> labels;
  for (const auto& [label, observation] : observations.of_camera[a]) {
    if (observations.of_camera[b].count(label)) labels.push_back(label);
  }
  return ThinnedTo(labels, kMostJoints);
}

struct Pair {
  size_t a = 0, b = 0;
  Rigid3 b_from_a;
  double share = 0, score = -1;
  size_t num_common = 0, num_fitting = 0;  // joints, of at most kMostJoints
};

/// The relative pose that most common joints fit, with a translation of length 1.
Pair Relate(const JointObservations& observations, size_t a, size_t b) {
  Pair pair{a, b, {}, 0, -1};
  const std::vector<Label> labels = Common(observations, a, b);
  pair.num_common = labels.size();
  if (labels.size() < kFewestJoints) return pair;
  opengv::bearingVectors_t in_a, in_b;
  for (const Label& label : labels)
    in_a.push_back(observations.of_camera[a].at(label).ray), in_b.push_back(observations.of_camera[b].at(label).ray);
  opengv::relative_pose::CentralRelativeAdapter adapter(in_a, in_b);
  using Problem = opengv::sac_problems::relative_pose::CentralRelativePoseSacProblem;
  opengv::sac::Ransac<Problem> ransac;
  ransac.sac_model_ = std::make_shared<Problem>(adapter, Problem::NISTER, false);
  ransac.threshold_ = 2 * (1 - std::cos(3 * std::max(observations.sigma_rad[a], observations.sigma_rad[b])));
  ransac.max_iterations_ = 2000;
  const bool found = ransac.computeModel(0);
  pair.num_fitting = found ? ransac.inliers_.size() : 0;
  if (pair.num_fitting < kFewestJoints) return pair;
  opengv::transformation_t a_from_b;
  ransac.sac_model_->optimizeModelCoefficients(ransac.inliers_, ransac.model_coefficients_, a_from_b);
  if (!a_from_b.allFinite() || !(a_from_b.col(3).norm() > 0)) return pair;
  Rigid3 pose;
  pose.rotation = geometry::NearestRotation(a_from_b.leftCols<3>());
  pose.translation = a_from_b.col(3).normalized();
  std::vector<double> sines;
  for (const int i : ransac.inliers_) {
    const auto k = static_cast<size_t>(i);
    sines.push_back(in_a[k].cross(pose.rotation * in_b[k]).norm());
  }
  pair.b_from_a = geometry::Inverse(pose);
  pair.share = static_cast<double>(ransac.inliers_.size()) / static_cast<double>(labels.size());
  pair.score = static_cast<double>(ransac.inliers_.size()) * UpperMedian(std::move(sines), 0);
  return pair;
}

Pair BestPair(const JointObservations& observations) {
  Pair best;
  for (size_t a = 0; a < observations.of_camera.size(); ++a) {
    for (size_t b = a + 1; b < observations.of_camera.size(); ++b) {
      const Pair pair = Relate(observations, a, b);
      const auto rank = [](const Pair& p) { return std::tuple(p.score, p.num_fitting, p.num_common); };
      if (rank(pair) > rank(best)) best = pair;
    }
  }
  return best;
}

/// What the best pair of cameras lacks.
std::string WhyNoPair(const geometry::Rig& lenses, const JointObservations& observations, const Pair& best) {
  if (lenses.cameras.size() < 2 || best.num_common == 0)
    return "no two cameras see a joint at once; two that see one person at once are needed, each frame in both";
  std::set<int> frames;
  for (const Label& label : Common(observations, best.a, best.b)) frames.insert(label.first);
  const std::string who = "cameras " + lenses.cameras[best.a].camera.name + " and " + lenses.cameras[best.b].camera.name;
  const std::string seen = Format(" see %zu joints at once, in %zu frames", best.num_common, frames.size());
  if (best.num_common < kFewestJoints)
    return who + seen + Format("; at least %zu are needed, of a person who walks through what both see", kFewestJoints);
  return who + seen + Format(", of which %zu fit one relative pose; at least %zu must: ", best.num_fitting, kFewestJoints) +
         "are they synchronous, of the same person, and the lenses theirs?";
}

/// Joints that the placed cameras triangulate.
std::map<Label, Eigen::Vector3d> Triangulated(const geometry::Rig& rig, const std::set<size_t>& placed,
                                              const JointObservations& seen_joints) {
  const triangulate::PreparedRig prepared = triangulate::Prepare(rig);
  std::map<Label, std::vector<triangulate::Observation>> seen;
  for (const size_t c : placed) {
    for (const auto& [label, observation] : seen_joints.of_camera[c])
      seen[label].push_back({static_cast<int>(c), observation.px, seen_joints.sigma_px[c], 1});
  }
  std::map<Label, Eigen::Vector3d> points;
  for (const auto& [label, observations] : seen) {
    if (observations.size() < 2) continue;
    const triangulate::Point point = triangulate::TriangulatePoint(prepared, observations);
    if (point.status == Status::kOk) points[label] = point.x_in_world;
  }
  return points;
}

PointResection Resect(const geometry::RigCamera& camera, const std::map<Label, SeenJoint>& seen_joints, double sigma_px,
                      const std::map<Label, Eigen::Vector3d>& points) {
  std::vector<Label> labels;
  for (const auto& [label, x] : points) {
    if (seen_joints.count(label)) labels.push_back(label);
  }
  PointResection none;
  none.status = Status::kTooFewViews;
  none.message = Format("it shares %zu joints with the cameras that are placed; %zu are needed", labels.size(), kFewestJoints);
  if (labels.size() < kFewestJoints) return none;
  labels = ThinnedTo(labels, 400);
  std::vector<PointClick> clicks;
  Eigen::Matrix3Xd x(3, static_cast<Eigen::Index>(labels.size()));
  for (size_t i = 0; i < labels.size(); ++i) {
    clicks.push_back({0, static_cast<int>(i), seen_joints.at(labels[i]).px});
    x.col(static_cast<Eigen::Index>(i)) = points.at(labels[i]);
  }
  PointResectionOptions options;
  options.click_sigma_px = sigma_px;
  return ResectFromPoints({{camera.camera, Rigid3(), std::nullopt, std::nullopt}}, clicks, x, options);
}

/// The camera that shares most joints with the points and is not placed.
size_t Next(const JointObservations& observations, const std::set<size_t>& done,
            const std::map<Label, Eigen::Vector3d>& points) {
  size_t best = 0, most = 0;
  bool any = false;
  for (size_t c = 0; c < observations.of_camera.size(); ++c) {
    if (done.count(c)) continue;
    const auto shared = static_cast<size_t>(std::count_if(
        points.begin(), points.end(), [&](const auto& point) { return observations.of_camera[c].count(point.first) > 0; }));
    if (!any || shared > most) best = c, most = shared, any = true;
  }
  return best;
}

/// Scales the rig so that the known lengths come out; false when none was measured.
bool Scale(const std::map<Label, Eigen::Vector3d>& points, const std::vector<KnownLength>& lengths, PlacedRig* placed) {
  std::vector<double> factors;
  for (const KnownLength& known : lengths) {
    std::vector<double> measured;
    for (const auto& [label, x] : points) {
      if (label.second != known.joints.first) continue;
      const auto other = points.find({label.first, known.joints.second});
      if (other != points.end()) measured.push_back((other->second - x).norm());
    }
    const double median = UpperMedian(std::move(measured), 0);
    if (median > 0) factors.push_back(known.length_m / median);
  }
  if (factors.empty()) return false;
  double mean = 0, squares = 0;
  for (const double f : factors) mean += f / static_cast<double>(factors.size());
  for (const double f : factors) squares += (f - mean) * (f - mean) / static_cast<double>(factors.size());
  placed->length_spread = std::sqrt(squares) / mean;
  for (geometry::RigCamera& camera : placed->rig.cameras) camera.cam_from_world.translation *= mean;
  return true;
}

PlacedRig Fail(Status status, std::string message) {
  PlacedRig placed;
  placed.status = status, placed.message = std::move(message);
  return placed;
}

/// All cameras from the best pair on; the pair's distance is 1.
PlacedRig PlaceAll(const geometry::Rig& lenses, const JointObservations& observations,
                   std::map<Label, Eigen::Vector3d>* points) {
  const Pair pair = BestPair(observations);
  if (pair.score < 0) return Fail(Status::kTooFewViews, WhyNoPair(lenses, observations, pair));
  PlacedRig placed;
  placed.inlier_share = pair.share;
  for (const geometry::RigCamera& camera : lenses.cameras)
    placed.rig.cameras.push_back({camera.camera, Rigid3(), camera.params_covariance, std::nullopt});
  placed.rig.cameras[pair.b].cam_from_world = pair.b_from_a;
  std::set<size_t> done = {pair.a, pair.b};
  *points = Triangulated(placed.rig, done, observations);
  while (done.size() < lenses.cameras.size()) {
    const size_t c = Next(observations, done, *points);
    const PointResection pose = Resect(lenses.cameras[c], observations.of_camera[c], observations.sigma_px[c], *points);
    if (pose.status != Status::kOk)
      return Fail(pose.status, lenses.cameras[c].camera.name + " cannot be placed: " + pose.message);
    placed.rig.cameras[c].cam_from_world = pose.rig_from_world;
    done.insert(c);
    *points = Triangulated(placed.rig, done, observations);
  }
  return placed;
}

}  // namespace

PlacedRig PlaceFromKeypoints(const geometry::Rig& lenses, const std::vector<DetectedFrame>& frames,
                             const std::vector<KnownLength>& lengths, double min_score) {
  std::map<Label, Eigen::Vector3d> points;
  PlacedRig placed = PlaceAll(lenses, Collect(lenses, frames, min_score), &points);
  if (placed.status != Status::kOk) return placed;
  if (!Scale(points, lengths, &placed))
    return Fail(Status::kDegenerate, "no bone of known length was measured, so nothing says how large the rig is");
  const Rigid3 world_from_first = geometry::Inverse(placed.rig.cameras[0].cam_from_world);
  for (geometry::RigCamera& camera : placed.rig.cameras) camera.cam_from_world = camera.cam_from_world * world_from_first;
  placed.rig.gauge = geometry::RigGauge::OfCamera(placed.rig.cameras[0].camera.name);
  return placed;
}

std::optional<geometry::Rig> PlaceAnew(const geometry::Rig& lenses, const std::vector<KeypointJoint>& joints) {
  std::map<Label, Eigen::Vector3d> points;
  const PlacedRig placed = PlaceAll(lenses, CollectJoints(lenses, joints), &points);
  return placed.status == Status::kOk ? std::optional(placed.rig) : std::nullopt;
}

std::optional<geometry::Rig> PlaceByOthers(const geometry::Rig& rig, const std::vector<KeypointJoint>& joints,
                                           const std::vector<size_t>& wrong) {
  const JointObservations observations = CollectJoints(rig, joints);
  std::set<size_t> done;
  for (size_t c = 0; c < rig.cameras.size(); ++c) done.insert(c);
  for (const size_t c : wrong) done.erase(c);
  if (done.size() < 2) return std::nullopt;
  geometry::Rig placed = rig;
  bool any = false;
  for (const size_t c : wrong) {
    const PointResection pose =
        Resect(rig.cameras[c], observations.of_camera[c], observations.sigma_px[c], Triangulated(placed, done, observations));
    done.insert(c);
    if (pose.status != Status::kOk) continue;
    placed.cameras[c].cam_from_world = pose.rig_from_world, any = true;
  }
  return any ? std::optional(placed) : std::nullopt;
}

}  // namespace mvstudio::calib
