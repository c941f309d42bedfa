#include "triangulate/point/refine.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/lens/lens_derivatives.h"

namespace mvstudio::triangulate {
namespace {

struct Linearization {
  Status status = Status::kOk;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double chi_squared = 0;
  double worst_squared = 0;
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

Linearization Linearize(const std::vector<View>& views, const Eigen::Vector3d& x_in_local) {
  Linearization sum;
  geometry::LensDerivatives derivatives;
  Eigen::Vector2d px;
  for (const View& view : views) {
    sum.status = ProjectPoint(view.camera->projector, view.camera->ToCam(x_in_local), &px, &derivatives);
    if (sum.status != Status::kOk) return sum;
    const double weight = 1 / view.sigma_px;
    const Eigen::Vector2d residual = weight * (px - view.px);
    const Eigen::Matrix<double, 2, 3> jacobian = weight * derivatives.d_px_d_x_in_cam * view.camera->cam_from_local_rotation;
    sum.information.noalias() += jacobian.transpose() * jacobian;
    sum.gradient.noalias() += jacobian.transpose() * residual;
    sum.chi_squared += residual.squaredNorm();
    sum.worst_squared = std::max(sum.worst_squared, residual.squaredNorm());
  }
  if (!std::isfinite(sum.chi_squared)) sum.status = Status::kOutsideValidRadius;
  return sum;
}

Refinement Finish(Status status, const Eigen::Vector3d& x_in_local, const Linearization& at) {
  return {status, x_in_local, at.information, at.chi_squared, std::sqrt(at.worst_squared)};
}

}  // namespace

Refinement Evaluate(const std::vector<View>& views, const Eigen::Vector3d& x_in_local) {
  const Linearization at = Linearize(views, x_in_local);
  return Finish(at.status, x_in_local, at);
}

Refinement Refine(const std::vector<View>& views, const Eigen::Vector3d& start_in_local, int max_iterations) {
  constexpr double kTinyStep = 1e-12;  // (1e-6 sigma)^2: the next Gauss-Newton step is below rounding
  Eigen::Vector3d x = start_in_local;
  Linearization at = Linearize(views, x);
  if (at.status != Status::kOk) return Finish(at.status, x, at);
  double damping = 0;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    Eigen::Matrix3d damped = at.information;
    damped.diagonal() *= 1 + damping;
    const Eigen::LDLT<Eigen::Matrix3d> factor(damped);
    if (factor.info() != Eigen::Success || !factor.isPositive()) return Finish(Status::kDegenerate, x, at);
    const Eigen::Vector3d step = factor.solve(-at.gradient);
    if (!step.allFinite()) return Finish(Status::kDegenerate, x, at);
    const bool tiny = step.dot(at.information * step) < kTinyStep;
    const Linearization next = Linearize(views, x + step);
    if (next.status == Status::kOk && (tiny || next.chi_squared <= at.chi_squared)) {
      x += step;
      at = next;
      damping = damping < 1e-8 ? 0 : damping / 10;
      if (tiny) return Finish(Status::kOk, x, at);
    } else {
      if (tiny) return Finish(Status::kOk, x, at);
      damping = damping == 0 ? 1e-3 : damping * 10;
      if (damping > 1e12) return Finish(Status::kNotConverged, x, at);
    }
  }
  return Finish(Status::kNotConverged, x, at);
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
