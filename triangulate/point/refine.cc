#include "triangulate/point/refine.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/lens/lens_derivatives.h"
#include "geometry/solve/least_squares.h"

namespace mvstudio::triangulate {
namespace {

constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();  // of a projection, relative

/// The cost is chi squared.
struct Linearization : geometry::NormalEquations<3> {
  Status status = Status::kOk;
  double worst_squared = 0;
  double rounding = 0;  ///< of the cost, squared residuals that rounding of the pixels alone makes
};

Status ProjectPinhole(const geometry::Camera& camera, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* px,
                      geometry::LensDerivatives* derivatives) {
  if (!(x_in_cam.z() > 0)) return Status::kBehindCamera;
  const double inverse = 1 / x_in_cam.z(), a = x_in_cam.x() * inverse, b = x_in_cam.y() * inverse;
  *px << camera.fx() * a + camera.cx(), camera.fy() * b + camera.cy();
  const double by_a = camera.fx() * inverse, by_b = camera.fy() * inverse;
  derivatives->d_px_d_x_in_cam << by_a, 0, -by_a * a, 0, by_b, -by_b * b;
  return px->allFinite() ? Status::kOk : Status::kOutsideValidRadius;
}

/// Pixel of a point and its derivative, or why there is none. As Projector::ProjectWithJacobians, without the lens parameters.
Status ProjectPoint(const geometry::Projector& projector, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* px,
                    geometry::LensDerivatives* derivatives) {
  const geometry::Camera& camera = projector.camera();
  if (camera.model == geometry::LensModel::kPinhole) return ProjectPinhole(camera, x_in_cam, px, derivatives);
  if (geometry::IsWide(camera.model)) {
    const Status status = projector.Project(x_in_cam).status;
    if (status != Status::kOk) return status;
  } else {
    if (!(x_in_cam.z() > 0)) return Status::kBehindCamera;
    const double a = x_in_cam.x() / x_in_cam.z(), b = x_in_cam.y() / x_in_cam.z(), limit = projector.valid_radius();
    if (!(a * a + b * b <= limit * limit)) return Status::kOutsideValidRadius;
  }
  return geometry::ProjectLens(camera, x_in_cam, px, derivatives) ? Status::kOk : Status::kOutsideValidRadius;
}

struct PointProblem : geometry::LeastSquaresProblem<3, Eigen::Vector3d, Linearization> {
  const std::vector<View>& views;

  explicit PointProblem(const std::vector<View>& of) : views(of) {}
  Eigen::Vector3d Retract(const Eigen::Vector3d& x_in_local, const Eigen::Vector3d& step) const { return x_in_local + step; }

  bool Linearize(const Eigen::Vector3d& x_in_local, Linearization* sum) const {
    geometry::LensDerivatives derivatives;
    Eigen::Vector2d px;
    for (const View& view : views) {
      sum->status = ProjectPoint(view.camera->projector, view.camera->ToCam(x_in_local), &px, &derivatives);
      if (sum->status != Status::kOk) return false;
      const double weight = 1 / view.sigma_px;
      const Eigen::Vector2d residual = weight * (px - view.px);
      const Eigen::Matrix<double, 2, 3> jacobian = weight * derivatives.d_px_d_x_in_cam * view.camera->cam_from_local_rotation;
      sum->h.noalias() += jacobian.transpose() * jacobian;
      sum->g.noalias() += jacobian.transpose() * residual;
      sum->cost += residual.squaredNorm();
      const double rounding = kRounding * weight * (px.lpNorm<1>() + view.camera->focal_px);
      sum->rounding += rounding * rounding;
      sum->worst_squared = std::max(sum->worst_squared, residual.squaredNorm());
    }
    if (!std::isfinite(sum->cost)) sum->status = Status::kOutsideValidRadius;
    return sum->status == Status::kOk;
  }

  Eigen::Vector3d SolveStep(const Linearization& at, double damping) const {
    Eigen::Matrix3d damped = at.h;
    damped.diagonal() *= 1 + damping;
    const Eigen::LDLT<Eigen::Matrix3d> factor(damped);
    if (factor.info() != Eigen::Success || !factor.isPositive()) return Eigen::Vector3d::Constant(std::nan(""));
    return factor.solve(-at.g);
  }

  geometry::StepVerdict Judge(const geometry::LeastSquaresOptions&, const Eigen::Vector3d& step, const Linearization& at,
                              const Linearization* trial) const {
    constexpr double kTinyStep = 1e-12;  // (1e-6 sigma)^2: the next Gauss-Newton step is below rounding
    if (step.dot(at.h * step) < std::max(kTinyStep, at.rounding))
      return trial ? geometry::StepVerdict::kTakeLast : geometry::StepVerdict::kRest;
    return trial && trial->cost <= at.cost ? geometry::StepVerdict::kTake : geometry::StepVerdict::kRefuse;
  }
};

Refinement Finish(Status status, const Eigen::Vector3d& x_in_local, const Linearization& at) {
  return {status, x_in_local, at.h, at.cost, std::sqrt(at.worst_squared)};
}

}  // namespace

Refinement Evaluate(const std::vector<View>& views, const Eigen::Vector3d& x_in_local) {
  Linearization at;
  PointProblem(views).Linearize(x_in_local, &at);
  return Finish(at.status, x_in_local, at);
}

Refinement Refine(const std::vector<View>& views, const Eigen::Vector3d& start_in_local, int max_iterations) {
  geometry::LeastSquaresOptions options;
  options.max_iterations = max_iterations;
  options.first_damping = 0, options.none_below = 1e-8, options.max_damping = 1e13;
  const auto end = geometry::SolveLeastSquares(PointProblem(views), start_in_local, options);
  const Status why_not = end.equations.status;  // of the start; no other state is kept that has none
  return Finish(why_not == Status::kOk ? end.status : why_not, end.state, end.equations);
}

double WhitenedResidual(const View& view, const Eigen::Vector3d& x_in_local) {
  const geometry::Projection projection = view.camera->projector.Project(view.camera->ToCam(x_in_local));
  if (projection.status != Status::kOk) return std::numeric_limits<double>::infinity();
  return (projection.px - view.px).norm() / view.sigma_px;
}

Eigen::Matrix<double, 2, 3> WhitenedRows(const View& view) {
  geometry::LensDerivatives derivatives;
  Eigen::Vector2d px;
  const Eigen::Vector3d ray_in_cam = view.camera->cam_from_local_rotation * view.ray_in_local;
  if (!geometry::ProjectLens(view.camera->projector.camera(), ray_in_cam, &px, &derivatives)) {
    return Eigen::Matrix<double, 2, 3>::Zero();
  }
  return derivatives.d_px_d_x_in_cam * view.camera->cam_from_local_rotation / view.sigma_px;
}

}  // namespace mvstudio::triangulate
