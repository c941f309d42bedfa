#include "triangulate/people/affinity.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/statistics.h"

namespace mvstudio::triangulate::internal {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kLimit1 = 9.0;     // 3 sigma squared: 99.7 % of chi^2 with 1 degree of freedom
constexpr double kLimit2 = 11.8;    // and with 2
constexpr double kMedian1 = 0.455;  // of chi^2 with 1 degree of freedom

double LimitRad(const PreparedCamera& camera, const AssociationOptions& options) {
  const geometry::Camera& lens = camera.projector.camera();
  const double limit_px = options.max_error_px > 0 ? options.max_error_px : 0.015 * std::hypot(lens.width_px, lens.height_px);
  return limit_px / camera.focal_px;
}

int CommonJoints(const Candidate& a, const Candidate& b, const AssociationOptions& options) {
  return std::min({options.min_joints, static_cast<int>(a.rays.size()), static_cast<int>(b.rays.size())});
}

/// Squared distances of common joints' rays in units of sigma; empty when there are too few.
std::vector<double> SquaredDistances(const Candidate& a, const Candidate& b, double sigma_px,
                                     const AssociationOptions& options) {
  std::vector<double> distances;
  const size_t num_joints = std::min(a.rays.size(), b.rays.size());
  distances.reserve(num_joints);
  for (size_t j = 0; j < num_joints; ++j) {
    if (a.is_seen[j] && b.is_seen[j]) distances.push_back(SquaredRayDistance(a, b, j, j, sigma_px));
  }
  if (static_cast<int>(distances.size()) < std::max(1, CommonJoints(a, b, options))) distances.clear();
  return distances;
}

}  // namespace

std::vector<Candidate> MakeCandidates(const PreparedRig& rig, const DetectedFrame& frame, const AssociationOptions& options) {
  std::vector<Candidate> candidates;
  for (size_t c = 0; c < frame.people.size(); ++c) {
    const PreparedCamera& camera = rig.cameras[c];
    for (size_t p = 0; p < frame.people[c].size(); ++p) {
      const DetectedPerson& person = frame.people[c][p];
      Candidate candidate{static_cast<int>(c),
                          static_cast<int>(p),
                          camera.center_in_local,
                          camera.focal_px,
                          LimitRad(camera, options),
                          {},
                          {},
                          0};
      candidate.rays.resize(person.size());
      candidate.is_seen.assign(person.size(), 0);
      for (size_t j = 0; j < person.size(); ++j) {
        if (!(person[j].score >= options.min_score) || !(person[j].score > 0) || !person[j].px.allFinite()) continue;
        const geometry::Unprojection ray = camera.projector.Unproject(person[j].px);
        if (ray.status != Status::kOk) continue;
        candidate.rays[j] = camera.cam_from_local_rotation.transpose() * ray.ray_in_cam;
        candidate.is_seen[j] = 1;
        ++candidate.num_seen;
      }
      if (candidate.num_seen > 0) candidates.push_back(std::move(candidate));
    }
  }
  return candidates;
}

double SquaredRayDistance(const Candidate& a, const Candidate& b, size_t joint_a, size_t joint_b, double sigma_px) {
  const Eigen::Vector3d& ray_a = a.rays[joint_a];
  const Eigen::Vector3d& ray_b = b.rays[joint_b];
  const Eigen::Vector3d across = ray_a.cross(ray_b), base = b.center - a.center;
  const double sine2 = across.squaredNorm();
  if (!(sine2 > 1e-12)) return 0;  // parallel: nothing speaks against a point far away
  const double depth_a = base.cross(ray_b).dot(across) / sine2, depth_b = base.cross(ray_a).dot(across) / sine2;
  if (depth_a <= 0 || depth_b <= 0) return kInfinity;
  const double gap = base.dot(across);
  const double noise_a = sigma_px / a.focal_px * depth_a, noise_b = sigma_px / b.focal_px * depth_b;
  return gap * gap / (sine2 * (noise_a * noise_a + noise_b * noise_b));
}

double PairEvidence(const Candidate& a, const Candidate& b, double sigma_px, const AssociationOptions& options) {
  if (a.camera_idx == b.camera_idx) return -kInfinity;
  double sum = 0;
  for (const double squared : SquaredDistances(a, b, sigma_px, options)) sum += Evidence(squared / kLimit1);
  return sum;
}

double AssociationSigma(const std::vector<std::vector<Candidate>>& frames, const AssociationOptions& options) {
  std::vector<double> best_fits;
  double limit_px = 0;
  for (const std::vector<Candidate>& candidates : frames) {
    int num_cameras = 0;
    for (const Candidate& each : candidates) {
      num_cameras = std::max(num_cameras, each.camera_idx + 1);
      limit_px = std::max(limit_px, each.limit_rad * each.focal_px);
    }
    for (const Candidate& a : candidates) {
      std::vector<double> least(static_cast<size_t>(num_cameras), kInfinity);
      for (const Candidate& b : candidates) {
        if (b.camera_idx <= a.camera_idx) continue;
        std::vector<double> squared = SquaredDistances(a, b, 1.0, options);
        if (!squared.empty()) least[b.camera_idx] = std::min(least[b.camera_idx], UpperMedian(squared));
      }
      for (const double each : least) {
        if (std::isfinite(each)) best_fits.push_back(each);
      }
    }
  }
  if (best_fits.empty()) return 0;
  // A limit is that of three sigma; a detector better than a tenth of it is not needed to tell people apart.
  return std::clamp(std::sqrt(UpperMedian(best_fits) / kMedian1), limit_px / 30, limit_px / 3);
}

void RaySum::Add(const Candidate& view, size_t joint, int sign) {
  const Eigen::Vector3d& ray = view.rays[joint];
  const Eigen::Matrix3d projector = Eigen::Matrix3d::Identity() - ray * ray.transpose();
  across += sign * projector;
  offset += sign * (projector * view.center);
  num_rays += sign;
}

std::optional<SketchPoint> Solve(const RaySum& sum) {
  if (sum.num_rays < 2) return std::nullopt;
  Eigen::Matrix3d inverse;
  bool invertible = false;
  sum.across.computeInverseWithCheck(inverse, invertible, 1e-9);  // the determinant is about num_rays^3 sin^2(parallax)
  if (!invertible) return std::nullopt;
  return SketchPoint{inverse * sum.offset, inverse};
}

double PointEvidence(const Candidate& view, size_t joint, const SketchPoint& point, double sigma_px) {
  const double sigma_rad = sigma_px / view.focal_px;
  const Eigen::Vector3d& ray = view.rays[joint];
  const Eigen::Vector3d arm = point.x - view.center;
  const double depth = ray.dot(arm);
  if (!(depth > 0)) return -1;
  const double miss2 = arm.squaredNorm() - depth * depth;
  const double spread = point.spread.trace() - ray.dot(point.spread * ray);
  return Evidence(miss2 / (kLimit2 * sigma_rad * sigma_rad * depth * depth * (1 + 0.5 * spread)));
}

double RayEvidence(const Candidate& a, size_t joint_a, const Candidate& b, size_t joint_b, double sigma_px) {
  return Evidence(SquaredRayDistance(a, b, joint_a, joint_b, sigma_px) / kLimit1);
}

double SketchEvidence(const Candidate& view, const std::vector<std::optional<SketchPoint>>& sketch, double sigma_px,
                      const AssociationOptions& options, int* num_agreeing) {
  double sum = 0;
  int num_common = 0;
  *num_agreeing = 0;
  for (size_t j = 0; j < std::min(view.rays.size(), sketch.size()); ++j) {
    if (!view.is_seen[j] || !sketch[j]) continue;
    const double evidence = PointEvidence(view, j, *sketch[j], sigma_px);
    sum += evidence;
    ++num_common, *num_agreeing += evidence > 0;
  }
  const int needed = std::max(1, std::min(options.min_joints, static_cast<int>(view.rays.size())));
  return num_common < needed ? -kInfinity : sum;
}

}  // namespace mvstudio::triangulate::internal
