#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opengv/absolute_pose/CentralAbsoluteAdapter.hpp>
#include <opengv/absolute_pose/NoncentralAbsoluteAdapter.hpp>
#include <opengv/absolute_pose/methods.hpp>

#include "calib/points/resection_problem.h"
#include "core/random.h"
#include "core/statistics.h"
#include "geometry/lens/lens_derivatives.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kMaxTriples = 1500;

/// Rays and points for OpenGV, of the clicks whose pixels a lens can have.
struct Bearings {
  opengv::bearingVectors_t rays;
  opengv::points_t points;
  std::vector<int> cameras, clicks;
};

Bearings ToBearings(const ResectionProblem& problem) {
  std::vector<geometry::Projector> projectors;
  for (const geometry::Camera& camera : problem.cameras) projectors.emplace_back(camera);
  Bearings out;
  for (size_t i = 0; i < problem.clicks.size(); ++i) {
    const PointClick& click = problem.clicks[i];
    const geometry::Unprojection ray = projectors[static_cast<size_t>(click.camera_idx)].Unproject(click.px);
    if (ray.status != Status::kOk) continue;
    out.rays.push_back(ray.ray_in_cam);
    out.points.push_back(problem.x_in_world.col(click.point_idx));
    out.cameras.push_back(click.camera_idx);
    out.clicks.push_back(static_cast<int>(i));
  }
  return out;
}

std::vector<Rigid3> FromOpenGv(const opengv::transformations_t& world_from_rig) {
  std::vector<Rigid3> poses;
  for (const opengv::transformation_t& m : world_from_rig) {
    if (!m.allFinite() || !(m.leftCols<3>().determinant() > 0.5)) continue;
    Rigid3 pose;
    pose.rotation = geometry::NearestRotation(m.leftCols<3>());
    pose.translation = m.col(3);
    poses.push_back(geometry::Inverse(pose));
  }
  return poses;
}

/// Poses rig_from_world that three clicks allow.
std::vector<Rigid3> FromTriple(const ResectionProblem& problem, const Bearings& b, const std::vector<int>& triple) {
  opengv::bearingVectors_t rays;
  opengv::points_t points;
  std::vector<int> cameras;
  for (const int i : triple) {
    const auto k = static_cast<size_t>(i);
    rays.push_back(b.rays[k]), points.push_back(b.points[k]), cameras.push_back(b.cameras[k]);
  }
  const bool central = cameras[0] == cameras[1] && cameras[1] == cameras[2];
  if (central) {
    opengv::absolute_pose::CentralAbsoluteAdapter adapter(rays, points);
    std::vector<Rigid3> poses = FromOpenGv(opengv::absolute_pose::p3p_kneip(adapter, std::vector<int>{0, 1, 2}));
    const Rigid3 rig_from_cam = geometry::Inverse(problem.cam_from_rig[static_cast<size_t>(cameras[0])]);
    for (Rigid3& pose : poses) pose = rig_from_cam * pose;
    return poses;
  }
  opengv::translations_t offsets;
  opengv::rotations_t rotations;
  for (const Rigid3& cam_from_rig : problem.cam_from_rig) {
    const Rigid3 rig_from_cam = geometry::Inverse(cam_from_rig);
    offsets.push_back(rig_from_cam.translation);
    rotations.push_back(rig_from_cam.rotation.toRotationMatrix());
  }
  opengv::absolute_pose::NoncentralAbsoluteAdapter adapter(rays, cameras, points, offsets, rotations);
  return FromOpenGv(opengv::absolute_pose::gp3p(adapter, std::vector<int>{0, 1, 2}));
}

std::vector<std::vector<int>> Triples(int n) {
  std::vector<std::vector<int>> triples;
  const int64_t all = static_cast<int64_t>(n) * (n - 1) * (n - 2) / 6;
  if (all <= kMaxTriples) {
    for (int a = 0; a < n; ++a)
      for (int b = a + 1; b < n; ++b)
        for (int c = b + 1; c < n; ++c) triples.push_back({a, b, c});
    return triples;
  }
  Rng rng(1);
  while (triples.size() < kMaxTriples) {
    const int a = static_cast<int>(rng.Index(n)), b = static_cast<int>(rng.Index(n)), c = static_cast<int>(rng.Index(n));
    if (a != b && b != c && a != c) triples.push_back({a, b, c});
  }
  return triples;
}

}  // namespace

Eigen::Matrix2Xd ResectionResiduals(const ResectionProblem& problem) {
  Eigen::Matrix2Xd residuals(2, static_cast<Eigen::Index>(problem.clicks.size()));
  for (size_t i = 0; i < problem.clicks.size(); ++i) {
    const PointClick& click = problem.clicks[i];
    const auto c = static_cast<size_t>(click.camera_idx);
    const Eigen::Vector3d x_in_rig = problem.rig_from_world * Eigen::Vector3d(problem.x_in_world.col(click.point_idx));
    Eigen::Vector2d px;
    const bool ok = geometry::ProjectLens(problem.cameras[c], problem.cam_from_rig[c] * x_in_rig, &px, nullptr);
    residuals.col(static_cast<Eigen::Index>(i)) = ok ? Eigen::Vector2d(px - click.px) : Eigen::Vector2d(kInfinity, kInfinity);
  }
  return residuals;
}

bool FindResectionStart(ResectionProblem* problem, double* middle_px) {
  const Bearings bearings = ToBearings(*problem);
  const auto n = static_cast<int>(bearings.clicks.size());
  if (n < 4) return false;
  const size_t rank = std::min<size_t>(problem->clicks.size() - 1, std::max<size_t>(3, (problem->clicks.size() + 3) / 2));
  ResectionProblem trial = *problem;
  *middle_px = kInfinity;
  for (const std::vector<int>& triple : Triples(n)) {
    for (const Rigid3& pose : FromTriple(*problem, bearings, triple)) {
      trial.rig_from_world = pose;
      const Eigen::Matrix2Xd residuals = ResectionResiduals(trial);
      Eigen::VectorXd lengths = residuals.colwise().norm().transpose();
      const double middle = ValueOfRank(lengths.begin(), lengths.end(), static_cast<std::ptrdiff_t>(rank));
      if (!(middle < *middle_px)) continue;
      *middle_px = middle;
      problem->rig_from_world = pose;
    }
  }
  return std::isfinite(*middle_px);
}

}  // namespace mvstudio::calib
