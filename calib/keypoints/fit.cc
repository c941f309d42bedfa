#include "calib/keypoints/fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "core/parallel.h"
#include "core/statistics.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/solve/least_squares.h"
#include "triangulate/point/point.h"

namespace mvstudio::calib {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr size_t kMaxViewsForPairs = 6;
constexpr double kMaxBehind = 2;    // in cost: minima that are farther behind are not remembered
constexpr double kSameCost = 1e-5;  // relative: descents that end so near each other ended in one minimum

/// Of the weighted squares.
struct Linearization : geometry::NormalEquations<3> {
  Eigen::Matrix3d curved = Eigen::Matrix3d::Zero();  // of the cost itself
};

struct JointProblem : geometry::LeastSquaresProblem<3, Eigen::Vector3d, Linearization> {
  const geometry::Rig& rig;
  const KeypointJoint& joint;
  double cauchy_px;

  JointProblem(const geometry::Rig& of_rig, const KeypointJoint& of_joint, double px)
      : rig(of_rig), joint(of_joint), cauchy_px(px) {}
  Eigen::Vector3d Retract(const Eigen::Vector3d& x, const Eigen::Vector3d& step) const { return x + step; }

  /// Normal equations of the reweighted residuals (projection - detection), and the cost's own second derivatives.
  bool Linearize(const Eigen::Vector3d& x, Linearization* sum) const {
    for (const triangulate::Observation& seen : joint.seen) {
      const geometry::RigCamera& camera = rig.cameras[static_cast<size_t>(seen.camera_idx)];
      Eigen::Vector2d px;
      geometry::LensDerivatives d;
      if (!geometry::ProjectLens(camera.camera, camera.cam_from_world * x, &px, &d)) return false;
      const Eigen::Vector2d r = px - seen.px;
      const double weight = cauchy_px > 0 ? 1 / (1 + r.squaredNorm() / (cauchy_px * cauchy_px)) : 1;
      const Eigen::Matrix<double, 2, 3> j = d.d_px_d_x_in_cam * camera.cam_from_world.rotation.toRotationMatrix();
      sum->cost += KeypointCost(r, cauchy_px);
      const Eigen::Vector3d along = j.transpose() * r;
      sum->h += weight * j.transpose() * j;
      sum->g += weight * along;
      if (cauchy_px > 0) sum->curved -= 2 * weight * weight / (cauchy_px * cauchy_px) * along * along.transpose();
    }
    sum->curved += sum->h;
    return true;
  }

  /// Newton's step where the cost is curved upwards; else that of iteratively reweighted least squares.
  Eigen::Vector3d SolveStep(const Linearization& at, double damping) const {
    Eigen::Matrix3d damped = at.curved;
    damped.diagonal() += damping * at.h.diagonal();
    const Eigen::LLT<Eigen::Matrix3d> newton(damped);
    if (newton.info() == Eigen::Success) return newton.solve(-at.g);
    return geometry::DampedStep(at.h, at.g, damping);
  }
};

/// The cost never grows.
std::optional<std::pair<double, Eigen::Vector3d>> Descend(const geometry::Rig& rig, const KeypointJoint& joint,
                                                          double cauchy_px, const Eigen::Vector3d& start) {
  geometry::LeastSquaresOptions options;
  options.max_iterations = 60;
  options.first_damping = 0, options.none_below = 1e-6, options.max_damping = 1e9;
  options.cost_tolerance = 1e-9;
  const auto end = geometry::SolveLeastSquares(JointProblem(rig, joint, cauchy_px), start, options);
  if (end.status != Status::kOk && end.status != Status::kNotConverged) return std::nullopt;
  return std::make_pair(end.equations.cost, end.state);
}

std::vector<Eigen::Vector3d> Starts(const triangulate::PreparedRig& prepared, const KeypointJoint& joint, double cauchy_px) {
  triangulate::PointOptions options;
  options.min_parallax_sigmas = 1e-3;
  std::vector<Eigen::Vector3d> starts;
  const auto add = [&](triangulate::PointMethod method, const std::vector<triangulate::Observation>& seen) {
    options.method = method;
    const triangulate::Point point = triangulate::TriangulatePoint(prepared, seen, options);
    if (point.status == Status::kOk) starts.push_back(point.x_in_world);
  };
  add(triangulate::PointMethod::kAllViews, joint.seen);
  if (starts.empty()) add(triangulate::PointMethod::kMidpoint, joint.seen);
  if (!(cauchy_px > 0) || joint.seen.size() < 3) return starts;
  if (joint.seen.size() > kMaxViewsForPairs) {
    std::vector<triangulate::Observation> scaled = joint.seen;
    for (triangulate::Observation& seen : scaled) seen.sigma_px = cauchy_px;
    add(triangulate::PointMethod::kRobust, scaled);
    return starts;
  }
  for (size_t a = 0; a < joint.seen.size(); ++a)
    for (size_t b = a + 1; b < joint.seen.size(); ++b) add(triangulate::PointMethod::kMidpoint, {joint.seen[a], joint.seen[b]});
  return starts;
}

/// The residuals at the point; not ok where a camera does not see it.
void Finish(const geometry::Rig& rig, const triangulate::PreparedRig& prepared, KeypointFit* fit) {
  fit->residuals_px.clear();
  for (const triangulate::Observation& seen : fit->joint->seen) {
    const auto c = static_cast<size_t>(seen.camera_idx);
    const auto projection = prepared.cameras[c].projector.Project(rig.cameras[c].cam_from_world * fit->x_in_world);
    fit->ok = fit->ok && projection.status == Status::kOk;
    fit->residuals_px.emplace_back(seen.px - projection.px);
  }
  if (!fit->ok) fit->residuals_px.assign(fit->joint->seen.size(), {kInfinity, kInfinity}), fit->cost = kInfinity;
}

KeypointFit FitFrom(const geometry::Rig& rig, const triangulate::PreparedRig& prepared, const KeypointJoint& joint,
                    double cauchy_px, const std::vector<Eigen::Vector3d>& starts) {
  std::vector<std::pair<double, Eigen::Vector3d>> ends;
  for (const Eigen::Vector3d& start : starts) {
    const auto end = Descend(rig, joint, cauchy_px, start);
    if (end) ends.push_back(*end);
  }
  std::stable_sort(ends.begin(), ends.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  KeypointFit fit;
  fit.joint = &joint, fit.cost = kInfinity;
  if (!ends.empty()) fit.ok = true, fit.cost = ends[0].first, fit.x_in_world = ends[0].second;
  for (size_t i = 1; i < ends.size() && ends[i].first < fit.cost + kMaxBehind; ++i)
    if (ends[i].first > (1 + kSameCost) * ends[i - 1].first) fit.others.push_back(ends[i].second);
  Finish(rig, prepared, &fit);
  return fit;
}

template <class Fit>
std::vector<KeypointFit> FitAll(size_t count, int num_threads, const Fit& fit) {
  std::vector<KeypointFit> fits(count);
  constexpr size_t kBlock = 64;
  ParallelFor(static_cast<int64_t>((count + kBlock - 1) / kBlock), num_threads, [&](int64_t block) {
    const size_t begin = static_cast<size_t>(block) * kBlock;
    for (size_t i = begin; i < std::min(count, begin + kBlock); ++i) fits[i] = fit(i);
  });
  return fits;
}

void MeasureLimbs(const std::vector<KeypointFit>& fits, const std::vector<std::pair<int, int>>& limbs, KeypointError* error) {
  std::map<std::tuple<int, int, int>, Eigen::Vector3d> points;  // person, frame, joint
  for (const KeypointFit& fit : fits)
    if (fit.ok) points[{fit.joint->person, fit.joint->frame, fit.joint->joint_idx}] = fit.x_in_world;
  std::map<std::pair<int, size_t>, std::vector<double>> lengths_mm;  // person, limb
  for (const auto& [key, x] : points) {
    for (size_t limb = 0; limb < limbs.size(); ++limb) {
      if (std::get<2>(key) != limbs[limb].first) continue;
      const auto other = points.find({std::get<0>(key), std::get<1>(key), limbs[limb].second});
      if (other != points.end()) lengths_mm[{std::get<0>(key), limb}].push_back(1e3 * (other->second - x).norm());
    }
  }
  std::vector<double> deviations, means;
  for (const auto& [key, values] : lengths_mm) {
    if (values.size() < 2) continue;
    deviations.push_back(PopulationDeviation(values)), means.push_back(Mean(values));
  }
  error->limb_std_mm = Mean(deviations), error->limb_mean_mm = Mean(means);
}

}  // namespace

double KeypointCost(const Eigen::Vector2d& residual_px, double cauchy_px) {
  const double squared = residual_px.squaredNorm();
  return cauchy_px > 0 ? std::log1p(squared / (cauchy_px * cauchy_px)) : squared;
}

std::vector<KeypointFit> FitKeypoints(const geometry::Rig& rig, const std::vector<KeypointJoint>& joints, double cauchy_px,
                                      int min_views, int num_threads) {
  const triangulate::PreparedRig prepared = triangulate::Prepare(rig);
  std::vector<const KeypointJoint*> enough;
  for (const KeypointJoint& joint : joints)
    if (static_cast<int>(joint.seen.size()) >= min_views) enough.push_back(&joint);
  return FitAll(enough.size(), num_threads, [&](size_t i) {
    return FitFrom(rig, prepared, *enough[i], cauchy_px, Starts(prepared, *enough[i], cauchy_px));
  });
}

std::vector<KeypointFit> RefitKeypoints(const geometry::Rig& rig, const std::vector<KeypointFit>& fits, double cauchy_px,
                                        int num_threads) {
  const triangulate::PreparedRig prepared = triangulate::Prepare(rig);
  return FitAll(fits.size(), num_threads, [&](size_t i) {
    if (!fits[i].ok) return fits[i];
    std::vector<Eigen::Vector3d> starts = fits[i].others;
    starts.insert(starts.begin(), fits[i].x_in_world);
    return FitFrom(rig, prepared, *fits[i].joint, cauchy_px, starts);
  });
}

double CauchyScale(const std::vector<KeypointFit>& fits) {
  constexpr double kMedianNormal2d = 1.17741, kMedianNormal = 0.67449;  // of lengths
  std::vector<double> lengths;
  for (const KeypointFit& fit : fits) {
    if (!fit.ok) continue;
    const double n = static_cast<double>(fit.residuals_px.size());
    double squares = 0;
    for (const Eigen::Vector2d& residual : fit.residuals_px) squares += residual.squaredNorm();
    const double of_pair = std::sqrt(squares) * kMedianNormal2d / kMedianNormal;
    for (const Eigen::Vector2d& residual : fit.residuals_px)
      lengths.push_back(n < 3 ? of_pair : std::sqrt(2 * n / (2 * n - 3)) * residual.norm());
  }
  return LinearQuantile(std::move(lengths), 0.5) / std::sqrt(3.0);
}

KeypointError ErrorOf(const std::vector<KeypointFit>& fits, const std::vector<std::pair<int, int>>& limbs) {
  KeypointError error;
  std::vector<double> lengths;
  for (const KeypointFit& fit : fits) {
    (fit.ok ? error.num_joints : error.num_failed) += 1;
    if (!fit.ok) continue;
    for (const Eigen::Vector2d& residual : fit.residuals_px) lengths.push_back(residual.norm());
  }
  error.mean_px = Mean(lengths);
  error.median_px = LinearQuantile(lengths, 0.5);
  error.p90_px = LinearQuantile(std::move(lengths), 0.9);
  MeasureLimbs(fits, limbs, &error);
  return error;
}

}  // namespace mvstudio::calib
