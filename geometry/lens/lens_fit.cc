#include "geometry/lens/lens_fit.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "core/units.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/lens/lens_fit_starts.h"
#include "geometry/lens/models/spline_grid.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::geometry {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMaxPerspectiveAngle = 80 * kPi / 180;
constexpr int kMaxTries = 3;  // starts that are adjusted to the end

RayBundle RaysOf(const Camera& from, int cols, double max_angle) {
  const Projector projector(from);
  RayBundle bundle;
  const int rows = std::max(2, static_cast<int>(std::lround(static_cast<double>(cols) * from.height_px / from.width_px)));
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < cols; ++i) {
      const Eigen::Vector2d px((from.width_px - 1.0) * i / (cols - 1), (from.height_px - 1.0) * j / (rows - 1));
      const Unprojection back = projector.Unproject(px);
      if (back.status != Status::kOk) continue;
      bundle.rays.push_back(back.ray_in_cam);
      bundle.px.push_back(px);
    }
  }
  return RaysUpTo(bundle, max_angle);
}

/// The unknowns: a lens and the direction that it looks in.
struct Candidate {
  Camera camera;
  Eigen::Quaterniond new_from_old = Eigen::Quaterniond::Identity();

  Candidate Moved(const Eigen::VectorXd& step) const {
    Candidate next = *this;
    const Eigen::Index count = camera.params.size();
    next.camera.params += step.head(count);
    if (step.size() > count) next.new_from_old = (RotationExp(step.tail<3>()) * new_from_old).normalized();
    return next;
  }
};

struct Evaluation {
  double cost = kInfinity;    // sum of squares; a ray without a pixel counts as the image's diagonal
  Eigen::MatrixXd jacobian;   // (2 N, P), or (2 N, P + 3) with the rotation
  Eigen::VectorXd residuals;  // (2 N) px
};

Evaluation Evaluate(const Candidate& candidate, const RayBundle& bundle) {
  Evaluation result;
  const Camera& camera = candidate.camera;
  if (!camera.params.allFinite() || !WhyInvalidLens(camera).empty()) return result;
  const Eigen::Matrix3d rotation = candidate.new_from_old.toRotationMatrix();
  const double lost_px = std::hypot(camera.width_px, camera.height_px);
  const Eigen::Index n = static_cast<Eigen::Index>(bundle.size());
  result.residuals = Eigen::VectorXd::Zero(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::Vector2d px;
    if (ProjectLens(camera, rotation * bundle.rays[i], &px, nullptr)) {
      result.residuals.segment<2>(2 * i) = px - bundle.px[i];
    } else {
      result.residuals[2 * i] = lost_px;
    }
  }
  result.cost = result.residuals.squaredNorm();
  return result;
}

Evaluation EvaluateWithJacobian(const Candidate& candidate, const RayBundle& bundle, const LensFitOptions& options) {
  Evaluation result = Evaluate(candidate, bundle);
  if (std::isinf(result.cost)) return result;
  const Eigen::Matrix3d rotation = candidate.new_from_old.toRotationMatrix();
  const Eigen::Index n = static_cast<Eigen::Index>(bundle.size()), count = candidate.camera.params.size();
  result.jacobian = Eigen::MatrixXd::Zero(2 * n, options.fit_rotation ? count + 3 : count);
  LensDerivatives d;
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::Vector2d px;
    const Eigen::Vector3d ray = rotation * bundle.rays[i];
    if (!ProjectLens(candidate.camera, ray, &px, &d)) continue;
    for (int j = 0; j < d.count; ++j) result.jacobian.block<2, 1>(2 * i, d.columns[j]) = d.d_px.col(j);
    if (!options.fit_rotation) continue;
    for (int row = 0; row < 2; ++row) {
      const Eigen::Vector3d gradient = d.d_px_d_x_in_cam.row(row);
      result.jacobian.block<1, 3>(2 * i + row, count) = ray.cross(gradient).transpose();
    }
  }
  if (options.keep_principal_point) result.jacobian.middleCols<2>(2).setZero();
  return result;
}

/// The step of damped least squares, columns scaled to one, by QR of the stacked system.
Eigen::VectorXd DampedStep(const Evaluation& at, double damping) {
  const Eigen::Index rows = at.jacobian.rows(), cols = at.jacobian.cols();
  Eigen::VectorXd scale = at.jacobian.colwise().norm();
  for (double& s : scale) s = s > 0 ? 1 / s : 0;
  Eigen::MatrixXd stacked(rows + cols, cols);
  stacked.topRows(rows) = at.jacobian * scale.asDiagonal();
  stacked.bottomRows(cols) = std::sqrt(damping) * Eigen::MatrixXd::Identity(cols, cols);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(rows + cols);
  right.head(rows) = -at.residuals;
  return stacked.householderQr().solve(right).cwiseProduct(scale);
}

/// Levenberg-Marquardt; true when it came to rest.
bool Adjust(const RayBundle& bundle, const LensFitOptions& options, Candidate* candidate, double* cost) {
  double damping = 1e-4;
  Evaluation at = EvaluateWithJacobian(*candidate, bundle, options);
  *cost = at.cost;
  if (std::isinf(at.cost)) return false;
  const double exact = 1e-22 * static_cast<double>(bundle.size());
  int small_steps = 0;
  for (int i = 0; i < options.max_iterations; ++i) {
    bool lowered = false;
    for (; damping < 1e12 && !lowered; damping *= 8) {
      const Candidate next = candidate->Moved(DampedStep(at, damping));
      const double next_cost = Evaluate(next, bundle).cost;
      if (!(next_cost < at.cost)) continue;
      lowered = true;
      // Along a flat valley (focal length against xi) steps stay small until the damping has gone.
      const bool small = (damping < 1e-9 && next_cost > (1 - 1e-7) * at.cost) || next_cost < exact;
      small_steps = small ? small_steps + 1 : 0;
      *candidate = next;
      damping /= 64;
    }
    // No step lowers the cost: rounding, or an optimum.
    if (!lowered || small_steps >= 3) return true;
    damping = std::max(damping, 1e-18);
    at = EvaluateWithJacobian(*candidate, bundle, options);
    *cost = at.cost;
  }
  return false;
}

/// Adjusts to the inner half of the angles first, then to all.
bool AdjustInStages(const RayBundle& bundle, const LensFitOptions& options, Candidate* candidate, double* cost) {
  const RayBundle inner = RaysUpTo(bundle, 0.5 * bundle.max_angle);
  if (static_cast<Eigen::Index>(inner.size()) >= candidate->camera.params.size()) Adjust(inner, options, candidate, cost);
  return Adjust(bundle, options, candidate, cost);
}

/// About `count` of the rays, evenly.
RayBundle Thin(const RayBundle& bundle, int count) {
  RayBundle some;
  some.max_angle = bundle.max_angle;
  const double step = std::max(1.0, static_cast<double>(bundle.size()) / count);
  for (double i = 0; i < static_cast<double>(bundle.size()); i += step) {
    some.rays.push_back(bundle.rays[static_cast<size_t>(i)]);
    some.px.push_back(bundle.px[static_cast<size_t>(i)]);
  }
  return some;
}

void Judge(const RayBundle& bundle, LensFit* fit) {
  const Projector projector(fit->camera);
  const Eigen::Matrix3d rotation = fit->new_from_old.toRotationMatrix();
  double sum = 0;
  for (size_t i = 0; i < bundle.size(); ++i) {
    const Projection projection = projector.Project(rotation * bundle.rays[i]);
    if (projection.status != Status::kOk) {
      ++fit->num_lost;
      continue;
    }
    const double error = (projection.px - bundle.px[i]).norm();
    sum += error * error;
    fit->max_px = std::max(fit->max_px, error);
  }
  fit->num_rays = static_cast<int>(bundle.size());
  const int seen = fit->num_rays - fit->num_lost;
  fit->rms_px = seen > 0 ? std::sqrt(sum / seen) : 0;
}

/// Starts after a short adjustment to some of the rays, best first.
std::vector<Candidate> BestStarts(const Camera& axis, LensModel to, const RayBundle& bundle, const LensFitOptions& options) {
  const RayBundle some = Thin(bundle, 4 * NumParams(to));
  LensFitOptions few = options;
  few.max_iterations = 12;
  std::vector<std::pair<double, Candidate>> starts;
  for (const Camera& camera : LensFitStarts(axis, to, bundle)) {
    Candidate start{camera};
    double cost = kInfinity;
    Adjust(some, few, &start, &cost);
    cost = Evaluate(start, bundle).cost;
    if (std::isfinite(cost)) starts.emplace_back(cost, start);
  }
  std::stable_sort(starts.begin(), starts.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Candidate> best;
  for (size_t i = 0; i < starts.size() && i < kMaxTries; ++i) best.push_back(starts[i].second);
  return best;
}

void FitParametric(const Camera& axis, LensModel to, const RayBundle& bundle, const LensFitOptions& options, LensFit* fit) {
  fit->status = Status::kDegenerate;
  const double good = 1e-14 * static_cast<double>(bundle.size());
  double best = kInfinity;
  for (const Candidate& start : BestStarts(axis, to, bundle, options)) {
    for (const bool staged : {false, true}) {
      Candidate candidate = start;
      double cost = kInfinity;
      const bool rests =
          staged ? AdjustInStages(bundle, options, &candidate, &cost) : Adjust(bundle, options, &candidate, &cost);
      if (!(cost < best)) continue;
      best = cost;
      fit->camera = candidate.camera;
      fit->new_from_old = candidate.new_from_old;
      fit->status = rests ? Status::kOk : Status::kNotConverged;
    }
    if (best < good) break;
  }
}

}  // namespace

RayBundle RaysUpTo(const RayBundle& bundle, double angle) {
  RayBundle kept;
  for (size_t i = 0; i < bundle.size(); ++i) {
    const double own = std::atan2(bundle.rays[i].head<2>().norm(), bundle.rays[i][2]);
    if (own > angle) continue;
    kept.rays.push_back(bundle.rays[i]);
    kept.px.push_back(bundle.px[i]);
    kept.max_angle = std::max(kept.max_angle, own);
  }
  return kept;
}

LensFit FitLens(const Camera& from, LensModel to, const LensFitOptions& options, const SplineGrid& spline) {
  Validate(from);
  MVS_CHECK(options.grid_cols >= 2 && options.grid_cols <= 4096, "grid_cols is " << options.grid_cols);
  MVS_CHECK(to != LensModel::kSplined || WhyInvalidGrid(spline).empty(), WhyInvalidGrid(spline));
  LensFit fit;
  const Camera axis = PinholeOf(from);
  fit.camera = axis;
  double limit = options.max_angle > 0 ? options.max_angle : kPi;
  if (!IsWide(to)) limit = std::min(limit, kMaxPerspectiveAngle);
  const int cols = to == LensModel::kSplined ? std::max(options.grid_cols, 4 * spline.cols) : options.grid_cols;
  const RayBundle bundle = RaysOf(from, cols, limit);
  fit.max_angle = bundle.max_angle;
  const int needed = to == LensModel::kSplined ? 4 : NumParams(to) + (options.fit_rotation ? 3 : 0);
  if (static_cast<int>(bundle.size()) < needed) {
    fit.status = Status::kTooFewViews;
    return fit;
  }
  if (to == LensModel::kSplined) {
    fit.camera = FitSpline(axis, spline, bundle);
  } else {
    FitParametric(axis, to, bundle, options, &fit);
  }
  if (fit.status != Status::kDegenerate) Judge(bundle, &fit);
  return fit;
}

SplineGrid SplineGridFor(const Camera& from, int order, int cols) {
  MVS_CHECK((order == 2 || order == 3) && cols > order, "order " << order << ", " << cols << " columns");
  Eigen::Vector2d reach(1e-3, 1e-3);
  for (const Eigen::Vector3d& ray : RaysOf(from, 64, 0.99 * kPi).rays) {
    reach = reach.cwiseMax((2 / (1 + ray[2]) * ray.head<2>()).cwiseAbs());
  }
  SplineGrid grid;
  grid.order = order;
  grid.cols = cols;
  grid.fov_x_deg = std::clamp(static_cast<int>(std::ceil(RadToDeg(4 * std::atan(1.05 * reach[0] / 2)))), 1, 359);
  grid.rows = order + std::max(1, static_cast<int>(std::ceil(2 * 1.05 * reach[1] * SegmentsPerU(grid))));
  return grid;
}

}  // namespace mvstudio::geometry
