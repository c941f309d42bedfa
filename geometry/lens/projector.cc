#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "geometry/lens/camera.h"
#include "geometry/lens/camera_model.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/lens/plane_inverse.h"
#include "geometry/lens/radial.h"
#include "geometry/lens/spline_grid.h"

namespace mvstudio::geometry {
namespace {

Unprojection NoRay(Status status) { return {status, Eigen::Vector3d::UnitZ()}; }
Projection NoPixel(Status status) { return {status, Eigen::Vector2d::Zero()}; }

/// A power of two that brings coordinates whose squares could over- or underflow into range; lenses only see directions.
double SafeScale(const Eigen::Vector3d& x) {
  const double size = x.lpNorm<Eigen::Infinity>();
  return (size > 1e-140 && size < 1e140) || size == 0 ? 1 : std::ldexp(1, -std::ilogb(size));
}

bool IsRadialOnly(const LensTerms& t) { return t.p1 == 0 && t.p2 == 0 && t.prism == std::array<double, 4>{}; }

}  // namespace

Projector::Projector(const Camera& camera) : camera_(camera), family_(RadialFamily(camera.model)) {
  Validate(camera);
  if (family_ == LensModel::kSplined) {
    valid_radius_ = 2 * std::atan(SplineHalfSize(camera.spline).minCoeff() / 2);
    return;
  }
  terms_ = TermsOf(camera);
  radial_only_ = IsRadialOnly(terms_);
  valid_radius_ = FirstFold(family_, terms_);
  valid_radius_squared_ = valid_radius_ * valid_radius_;
  max_distorted_radius_ = LargestRadius(family_, terms_, valid_radius_);
}

/// Finite points whose pixel overflows, or whose denominator rounds to nothing, lie beyond any radius.
Projection Projector::Formula(const Eigen::Vector3d& x_in_cam) const {
  Projection projection;
  if (!ProjectLens(camera_, x_in_cam, &projection.px, nullptr)) return NoPixel(Status::kOutsideValidRadius);
  return projection;
}

Projection Projector::Project(const Eigen::Vector3d& x_in_cam) const {
  if (!x_in_cam.allFinite()) return NoPixel(Status::kNonFiniteInput);
  if (IsWide(family_)) {
    const Eigen::Vector3d x = x_in_cam * SafeScale(x_in_cam);
    return family_ == LensModel::kSplined ? ProjectSplined(x) : ProjectWide(x);
  }
  if (!(x_in_cam[2] > 0)) return NoPixel(Status::kBehindCamera);
  const double a = x_in_cam[0] / x_in_cam[2], b = x_in_cam[1] / x_in_cam[2];
  if (family_ != LensModel::kPinhole && !(a * a + b * b <= valid_radius_squared_)) return NoPixel(Status::kOutsideValidRadius);
  return Formula(x_in_cam);
}

Projection Projector::ProjectWide(const Eigen::Vector3d& x) const {
  const double side = x.head<2>().stableNorm();
  if (side == 0 && !(x[2] > 0)) return NoPixel(Status::kBehindCamera);
  if (std::atan2(side, x[2]) > valid_radius_) return NoPixel(Status::kOutsideValidRadius);
  return Formula(x);
}

Projection Projector::ProjectSplined(const Eigen::Vector3d& x) const {
  const double denominator = SphereDenominator(1.0, 1.0, x.head<2>().squaredNorm(), x[2], x.norm());
  if (!(denominator > 0)) return NoPixel(Status::kBehindCamera);
  const Eigen::Vector2d u = 2 / denominator * x.head<2>();
  if (!(u.array().abs() <= SplineHalfSize(camera_.spline).array()).all()) return NoPixel(Status::kOutsideValidRadius);
  const SplineSample sample = SampleSpline(camera_.spline, camera_.params.data() + 4, u);
  if (!((Eigen::Matrix2d::Identity() + sample.d_offset_d_u).determinant() > 0)) return NoPixel(Status::kOutsideValidRadius);
  return Formula(x);
}

ProjectionWithJacobians Projector::ProjectWithJacobians(const Eigen::Vector3d& x_in_cam) const {
  const Projection projection = Project(x_in_cam);
  ProjectionWithJacobians result;
  result.status = projection.status;
  result.px = projection.px;
  result.d_px_d_params.setZero(2, camera_.params.size());
  if (result.status != Status::kOk) return result;
  const double scale = SafeScale(x_in_cam);
  LensDerivatives derivatives;
  Eigen::Vector2d px;
  if (!ProjectLens(camera_, scale * x_in_cam, &px, &derivatives)) {
    result.status = Status::kOutsideValidRadius;
    return result;
  }
  result.d_px_d_x = scale * derivatives.d_px_d_x_in_cam;
  for (int i = 0; i < derivatives.count; ++i) result.d_px_d_params.col(derivatives.columns[i]) = derivatives.d_px.col(i);
  return result;
}

Unprojection Projector::Unproject(const Eigen::Vector2d& px) const {
  if (!px.allFinite()) return NoRay(Status::kNonFiniteInput);
  if (family_ == LensModel::kSplined) return UnprojectSplined(px);
  return IsWide(family_) ? UnprojectWide(px) : UnprojectPerspective(px);
}

Unprojection Projector::UnprojectWide(const Eigen::Vector2d& px) const {
  const PlaneTarget target(camera_, px);
  Eigen::Vector2d ab = target.ab;
  if (!radial_only_) {
    const Status status = InvertPlane(LensModel::kPinhole, terms_, target, &ab);
    if (status != Status::kOk) return NoRay(status);
  }
  const double radius = ab.stableNorm();
  if (radius == 0) return {};
  if (!(radius <= max_distorted_radius_)) return NoRay(Status::kOutsideValidRadius);
  const double theta = InvertRadial(family_, terms_, radius, valid_radius_);
  const RadialValue found = EvaluateRadial(family_, terms_, theta);
  const double focal = target.focal.maxCoeff(), of_angle = 4 * std::numeric_limits<double>::epsilon() * found.slope * focal;
  if (!(std::abs(found.value - radius) * focal <= std::max(target.limit_px, of_angle))) return NoRay(Status::kNotConverged);
  const double sine = std::sin(theta) / radius;
  return {Status::kOk, {ab[0] * sine, ab[1] * sine, std::cos(theta)}};
}

Unprojection Projector::UnprojectPerspective(const Eigen::Vector2d& px) const {
  const PlaneTarget target(camera_, px);
  Eigen::Vector2d ab = target.ab;
  if (family_ != LensModel::kPinhole || !radial_only_) {
    const double radius = ab.stableNorm();
    const bool beyond = !(radius <= max_distorted_radius_);
    if (radial_only_ && beyond) return NoRay(Status::kOutsideValidRadius);
    const double start = InvertRadial(family_, terms_, std::min(radius, max_distorted_radius_), valid_radius_);
    if (radius > 0) ab *= start / radius;
    const Status status = InvertPlane(family_, terms_, target, &ab);
    if (ab.squaredNorm() > valid_radius_squared_) return NoRay(Status::kOutsideValidRadius);
    if (status != Status::kOk) return NoRay(beyond ? Status::kOutsideValidRadius : status);
  }
  return {Status::kOk, Eigen::Vector3d(ab[0], ab[1], 1).stableNormalized()};
}

Unprojection Projector::UnprojectSplined(const Eigen::Vector2d& px) const {
  const PlaneTarget target(camera_, px);
  Eigen::Vector2d u;
  const Status status = InvertSplined(camera_.spline, camera_.params.data() + 4, target, &u);
  if (status != Status::kOk) return NoRay(status);
  return {Status::kOk, Eigen::Vector3d(u[0], u[1], 1 - u.squaredNorm() / 4).normalized()};
}

Projection Project(const Camera& camera, const Eigen::Vector3d& x_in_cam) { return Projector(camera).Project(x_in_cam); }
Unprojection Unproject(const Camera& camera, const Eigen::Vector2d& px) { return Projector(camera).Unproject(px); }
double ValidRadius(const Camera& camera) { return Projector(camera).valid_radius(); }

}  // namespace mvstudio::geometry
