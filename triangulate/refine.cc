#include "triangulate/refine.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

namespace mvstudio::triangulate {
namespace {

struct Linearization {
  Status status = Status::kOk;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double chi_squared = 0;
};

Linearization Linearize(const std::vector<View>& views, const Eigen::Vector3d& x_in_local) {
  Linearization sum;
  for (const View& view : views) {
    const auto projection = view.camera->projector.ProjectWithJacobians(view.camera->ToCam(x_in_local));
    if (projection.status != Status::kOk) {
      sum.status = projection.status;
      return sum;
    }
    const Eigen::Vector2d residual = (projection.px - view.px) / view.sigma_px;
    const Eigen::Matrix<double, 2, 3> jacobian = projection.d_px_d_x * view.camera->cam_from_local_rotation / view.sigma_px;
    sum.information.noalias() += jacobian.transpose() * jacobian;
    sum.gradient.noalias() += jacobian.transpose() * residual;
    sum.chi_squared += residual.squaredNorm();
  }
  if (!std::isfinite(sum.chi_squared)) sum.status = Status::kOutsideValidRadius;
  return sum;
}

Refinement Finish(Status status, const Eigen::Vector3d& x_in_local, const Linearization& at) {
  return {status, x_in_local, at.information, at.chi_squared};
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

}  // namespace mvstudio::triangulate
