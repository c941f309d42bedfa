#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "geometry/lens/camera.h"
#include "geometry/lens/lens_derivatives.h"
#include "geometry/lens/models.h"
#include "geometry/lens/plane_inverse.h"

namespace mvstudio::geometry {
namespace {

using internal::PlaneTarget;

Unprojection NoRay(Status status) { return {status, Eigen::Vector3d::UnitZ()}; }
Projection NoPixel(Status status) { return {status, Eigen::Vector2d::Zero()}; }

/// A power of two that brings coordinates whose squares could over- or underflow into range; lenses only see directions.
double SafeScale(const Eigen::Vector3d& x) {
  const double size = x.lpNorm<Eigen::Infinity>();
  return (size > 1e-140 && size < 1e140) || size == 0 ? 1 : std::ldexp(1, -std::ilogb(size));
}

bool IsRadialOnly(const Camera& camera) {
  const LensTraits& traits = TraitsOf(camera.model);
  for (int i = 0; i < traits.num_params; ++i) {
    if (traits.params[i].IsAsymmetric() && camera.params[4 + i] != 0) return false;
  }
  return true;
}

}  // namespace

Projector::Projector(const Camera& camera) : camera_(camera) {
  Validate(camera);
  radial_only_ = IsRadialOnly(camera);
  const double* k = camera_.params.data() + 4;
  internal::VisitLens(camera_.model, camera_.spline, [&](auto lens) {
    if constexpr (decltype(lens)::kHasGrid) {
      valid_radius_ = 2 * std::atan(SplineHalfSize(lens.grid).minCoeff() / 2);
    } else {
      valid_radius_ = lens.FirstFold(k);
      valid_radius_squared_ = valid_radius_ * valid_radius_;
      max_distorted_radius_ = lens.LargestRadius(k, valid_radius_);
    }
  });
}

/// Finite points whose pixel overflows, or whose denominator rounds to nothing, lie beyond any radius.
Projection Projector::Formula(const Eigen::Vector3d& x_in_cam) const {
  Projection projection;
  if (!ProjectLens(camera_, x_in_cam, &projection.px, nullptr)) return NoPixel(Status::kOutsideValidRadius);
  return projection;
}

Projection Projector::Project(const Eigen::Vector3d& x_in_cam) const {
  if (!x_in_cam.allFinite()) return NoPixel(Status::kNonFiniteInput);
  const LensTraits& traits = TraitsOf(camera_.model);
  if (traits.wide) {
    const Eigen::Vector3d x = x_in_cam * SafeScale(x_in_cam);
    return traits.has_grid ? ProjectSplined(x) : ProjectWide(x);
  }
  if (!(x_in_cam[2] > 0)) return NoPixel(Status::kBehindCamera);
  const double a = x_in_cam[0] / x_in_cam[2], b = x_in_cam[1] / x_in_cam[2];
  if (traits.radial_terms && !(a * a + b * b <= valid_radius_squared_)) return NoPixel(Status::kOutsideValidRadius);
  return Formula(x_in_cam);
}

Projection Projector::ProjectWide(const Eigen::Vector3d& x) const {
  const double side = x.head<2>().stableNorm();
  if (side == 0 && !(x[2] > 0)) return NoPixel(Status::kBehindCamera);
  if (std::atan2(side, x[2]) > valid_radius_) return NoPixel(Status::kOutsideValidRadius);
  return Formula(x);
}

Projection Projector::ProjectSplined(const Eigen::Vector3d& x) const {
  internal::Splined::StereographicPoint<double> at;
  if (!internal::Splined::Stereographic(x, &at)) return NoPixel(Status::kBehindCamera);
  if (!(at.u.array().abs() <= SplineHalfSize(camera_.spline).array()).all()) return NoPixel(Status::kOutsideValidRadius);
  const SplineSample sample = SampleSpline(camera_.spline, camera_.params.data() + 4, at.u);
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
  return internal::VisitLens(camera_.model, camera_.spline, [&](auto lens) {
    using Lens = decltype(lens);
    if constexpr (Lens::kHasGrid) {
      return UnprojectSplined(px);
    } else if constexpr (Lens::kWide) {
      return UnprojectWide<Lens>(px);
    } else {
      return UnprojectPerspective<Lens>(px);
    }
  });
}

template <class Lens>
Unprojection Projector::UnprojectWide(const Eigen::Vector2d& px) const {
  const double* k = camera_.params.data() + 4;
  const PlaneTarget target(camera_, px);
  Eigen::Vector2d ab = target.ab;
  if (constexpr int p1 = TraitsOf(*internal::kModelOf<Lens>).decentring; p1 >= 0 && !radial_only_) {
    const Status status = internal::InvertPlane<internal::PinholeP>(k + p1, target, &ab);
    if (status != Status::kOk) return NoRay(status);
  }
  const double radius = ab.stableNorm();
  if (radius == 0) return {};
  if (!(radius <= max_distorted_radius_)) return NoRay(Status::kOutsideValidRadius);
  const double theta = Lens::InvertRadial(k, radius, valid_radius_);
  const internal::RadialValue found = Lens::Radial(k, theta);
  const double focal = target.focal.maxCoeff(), of_angle = 4 * std::numeric_limits<double>::epsilon() * found.slope * focal;
  if (!(std::abs(found.value - radius) * focal <= std::max(target.limit_px, of_angle))) return NoRay(Status::kNotConverged);
  const double sine = std::sin(theta) / radius;
  return {Status::kOk, {ab[0] * sine, ab[1] * sine, std::cos(theta)}};
}

template <class Lens>
Unprojection Projector::UnprojectPerspective(const Eigen::Vector2d& px) const {
  const double* k = camera_.params.data() + 4;
  const PlaneTarget target(camera_, px);
  Eigen::Vector2d ab = target.ab;
  if (TraitsOf(camera_.model).radial_terms || !radial_only_) {
    const double radius = ab.stableNorm();
    const bool beyond = !(radius <= max_distorted_radius_);
    if (radial_only_ && beyond) return NoRay(Status::kOutsideValidRadius);
    const double start = Lens::InvertRadial(k, std::min(radius, max_distorted_radius_), valid_radius_);
    if (radius > 0) ab *= start / radius;
    const Status status = internal::InvertPlane<Lens>(k, target, &ab);
    if (ab.squaredNorm() > valid_radius_squared_) return NoRay(Status::kOutsideValidRadius);
    if (status != Status::kOk) return NoRay(beyond ? Status::kOutsideValidRadius : status);
  }
  return {Status::kOk, Eigen::Vector3d(ab[0], ab[1], 1).stableNormalized()};
}

Unprojection Projector::UnprojectSplined(const Eigen::Vector2d& px) const {
  const PlaneTarget target(camera_, px);
  Eigen::Vector2d u;
  const Status status = internal::InvertSplined(camera_.spline, camera_.params.data() + 4, target, &u);
  if (status != Status::kOk) return NoRay(status);
  return {Status::kOk, Eigen::Vector3d(u[0], u[1], 1 - u.squaredNorm() / 4).normalized()};
}

Projection Project(const Camera& camera, const Eigen::Vector3d& x_in_cam) { return Projector(camera).Project(x_in_cam); }
Unprojection Unproject(const Camera& camera, const Eigen::Vector2d& px) { return Projector(camera).Unproject(px); }
double ValidRadius(const Camera& camera) { return Projector(camera).valid_radius(); }

}  // namespace mvstudio::geometry
