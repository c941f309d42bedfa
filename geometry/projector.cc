#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "geometry/camera.h"
#include "geometry/camera_model.h"
#include "geometry/radial.h"

namespace mvstudio::geometry {
namespace {

constexpr double kMaxResidualPx = 1e-9;

/// What a pixel's residual may be: 1e-9 px, or 8 roundings of numbers as large as its coordinates.
double ResidualLimit(const Eigen::Vector2d& px, double cx, double cy) {
  const double size = px.lpNorm<Eigen::Infinity>() + std::max(std::abs(cx), std::abs(cy));
  return std::max(kMaxResidualPx, 8 * std::numeric_limits<double>::epsilon() * size);
}

LensModel FormulaOf(LensModel model) {
  switch (model) {
    case LensModel::kPinhole:
    case LensModel::kRational8:
    case LensModel::kKannalaBrandt4:
      return model;
    default:
      return LensModel::kBrown5;
  }
}

/// d(a', b') by the distortion parameters, in their order. // (2, 8)
Eigen::Matrix<double, 2, 8> DistortionJacobian(const std::array<double, 8>& k, double a, double b) {
  const double s = a * a + b * b;
  const double n = 1 + s * (k[0] + s * (k[1] + s * k[4])), d = 1 + s * (k[5] + s * (k[6] + s * k[7]));
  const Eigen::Vector2d by_numerator = Eigen::Vector2d(a, b) / d, by_denominator = by_numerator * (-n / d);
  Eigen::Matrix<double, 2, 8> jacobian;
  jacobian << by_numerator * s, by_numerator * s * s, Eigen::Vector2d(2 * a * b, s + 2 * b * b),
      Eigen::Vector2d(s + 2 * a * a, 2 * a * b), by_numerator * s * s * s, by_denominator * s, by_denominator * s * s,
      by_denominator * s * s * s;
  return jacobian;
}

/// Image-plane coordinates (a, b) of kannala4 with their derivatives by the point and by k1 … k4.
struct FisheyePoint {
  Eigen::Vector2d ab;
  Eigen::Matrix<double, 2, 3> by_x;
  Eigen::Matrix<double, 2, 4> by_k;
};

FisheyePoint EvaluateFisheyePoint(const std::array<double, 8>& k, const Eigen::Vector3d& x) {
  const double side = x.head<2>().stableNorm(), theta = std::atan2(side, x[2]), distance = x.stableNorm();
  const RadialValue radial = EvaluateRadial(LensModel::kKannalaBrandt4, k, theta);
  const Eigen::Vector2d direction = side > 0 ? Eigen::Vector2d(x.head<2>() / side) : Eigen::Vector2d::Zero();
  const double tangential = side > 0 ? radial.value / side : 1 / x[2];
  const double along = radial.slope / distance;
  FisheyePoint point;
  point.ab = side > 0 ? Eigen::Vector2d(direction * radial.value) : Eigen::Vector2d::Zero();
  point.by_x.leftCols<2>() =
      tangential * Eigen::Matrix2d::Identity() + (along * (x[2] / distance) - tangential) * direction * direction.transpose();
  point.by_x.col(2) = -direction * along * (side / distance);
  double power = theta * theta * theta;
  for (int i = 0; i < 4; ++i, power *= theta * theta) point.by_k.col(i) = direction * power;
  return point;
}

}  // namespace

Projector::Projector(const Camera& camera) : camera_(camera), formula_(FormulaOf(camera.model)) {
  Validate(camera);
  fx_ = camera.fx(), fy_ = camera.fy(), cx_ = camera.cx(), cy_ = camera.cy();
  for (int i = 0; i < NumDistortionParams(camera.model); ++i) k_[i] = camera.params[4 + i];
  valid_radius_ = FirstFold(formula_, k_);
  valid_radius_squared_ = valid_radius_ * valid_radius_;
  max_distorted_radius_ = std::isinf(valid_radius_) ? valid_radius_ : EvaluateRadial(formula_, k_, valid_radius_).value;
}

Projection Projector::ToPixel(double a, double b) const {
  Projection projection;
  projection.px = {fx_ * a + cx_, fy_ * b + cy_};
  // Finite points whose pixel overflows lie beyond any radius.
  if (!projection.px.allFinite()) projection.status = Status::kOutsideValidRadius;
  return projection;
}

Projection Projector::Project(const Eigen::Vector3d& x_in_cam) const {
  const double x = x_in_cam[0], y = x_in_cam[1], z = x_in_cam[2];
  if (!x_in_cam.allFinite()) return {Status::kNonFiniteInput, Eigen::Vector2d::Zero()};
  if (formula_ == LensModel::kKannalaBrandt4) {
    const double side = x_in_cam.head<2>().stableNorm();
    if (side == 0) return z > 0 ? ToPixel(0, 0) : Projection{Status::kBehindCamera, Eigen::Vector2d::Zero()};
    const double theta = std::atan2(side, z);
    if (theta > valid_radius_) return {Status::kOutsideValidRadius, Eigen::Vector2d::Zero()};
    const double radius = KannalaBrandtRadius(k_.data(), theta);
    return ToPixel(x / side * radius, y / side * radius);
  }
  if (!(z > 0)) return {Status::kBehindCamera, Eigen::Vector2d::Zero()};
  const double a = x / z, b = y / z;
  if (formula_ == LensModel::kPinhole) return ToPixel(a, b);
  if (!(a * a + b * b <= valid_radius_squared_)) return {Status::kOutsideValidRadius, Eigen::Vector2d::Zero()};
  double distorted_a, distorted_b;
  DistortNormalized(formula_, k_.data(), a, b, &distorted_a, &distorted_b);
  return ToPixel(distorted_a, distorted_b);
}

Eigen::Vector2d Projector::Distort(double a, double b, Eigen::Matrix2d* jacobian) const {
  const double s = a * a + b * b, p1 = k_[2], p2 = k_[3];
  const double n = 1 + s * (k_[0] + s * (k_[1] + s * k_[4])), dn = k_[0] + s * (2 * k_[1] + s * 3 * k_[4]);
  const double d = 1 + s * (k_[5] + s * (k_[6] + s * k_[7])), dd = k_[5] + s * (2 * k_[6] + s * 3 * k_[7]);
  const double radial = n / d, slope = (dn - radial * dd) / d;
  const double cross = 2 * (a * b * slope + p1 * a + p2 * b);
  *jacobian << radial + 2 * a * a * slope + 2 * p1 * b + 6 * p2 * a, cross, cross,
      radial + 2 * b * b * slope + 6 * p1 * b + 2 * p2 * a;
  return {a * radial + 2 * p1 * a * b + p2 * (s + 2 * a * a), b * radial + p1 * (s + 2 * b * b) + 2 * p2 * a * b};
}

ProjectionWithJacobians Projector::ProjectWithJacobians(const Eigen::Vector3d& x_in_cam) const {
  const Projection projection = Project(x_in_cam);
  ProjectionWithJacobians result;
  result.status = projection.status;
  result.px = projection.px;
  const int num_distortion = NumDistortionParams(camera_.model);
  result.d_px_d_params.setZero(2, 4 + num_distortion);
  if (result.status != Status::kOk) return result;
  const Eigen::DiagonalMatrix<double, 2> focal(fx_, fy_);
  Eigen::Vector2d ab;
  if (formula_ == LensModel::kKannalaBrandt4) {
    const FisheyePoint point = EvaluateFisheyePoint(k_, x_in_cam);
    ab = point.ab;
    result.d_px_d_x = focal * point.by_x;
    result.d_px_d_params.rightCols(num_distortion) = focal * point.by_k;
  } else {
    const double inverse_z = 1 / x_in_cam[2], a = x_in_cam[0] * inverse_z, b = x_in_cam[1] * inverse_z;
    Eigen::Matrix2d distort;
    ab = Distort(a, b, &distort);
    Eigen::Matrix<double, 2, 3> divide;
    divide << inverse_z, 0, -a * inverse_z, 0, inverse_z, -b * inverse_z;
    result.d_px_d_x = focal * (distort * divide);
    result.d_px_d_params.rightCols(num_distortion) = focal * DistortionJacobian(k_, a, b).leftCols(num_distortion);
  }
  result.d_px_d_params.leftCols<4>() << ab[0], 0, 1, 0, 0, ab[1], 0, 1;
  return result;
}

Unprojection Projector::Unproject(const Eigen::Vector2d& px) const {
  if (!px.allFinite()) return {Status::kNonFiniteInput, Eigen::Vector3d::UnitZ()};
  return formula_ == LensModel::kKannalaBrandt4 ? UnprojectFisheye(px) : UnprojectPerspective(px);
}

Unprojection Projector::UnprojectFisheye(const Eigen::Vector2d& px) const {
  const Eigen::Vector2d distorted((px[0] - cx_) / fx_, (px[1] - cy_) / fy_);
  const double radius = distorted.stableNorm();
  if (radius == 0) return {};
  if (!(radius <= max_distorted_radius_)) return {Status::kOutsideValidRadius, Eigen::Vector3d::UnitZ()};
  const double theta = InvertRadial(formula_, k_, radius, valid_radius_);
  const double found = EvaluateRadial(formula_, k_, theta).value;
  const Eigen::Vector2d direction = distorted / radius;
  const double residual_px = std::abs(found - radius) * std::max(fx_, fy_);
  if (!(residual_px <= ResidualLimit(px, cx_, cy_))) return {Status::kNotConverged, Eigen::Vector3d::UnitZ()};
  const double sine = std::sin(theta);
  return {Status::kOk, {direction[0] * sine, direction[1] * sine, std::cos(theta)}};
}

Unprojection Projector::UnprojectPerspective(const Eigen::Vector2d& px) const {
  Eigen::Vector2d ab((px[0] - cx_) / fx_, (px[1] - cy_) / fy_);
  if (formula_ != LensModel::kPinhole) {
    const double radius = ab.stableNorm();
    const bool radial_only = k_[2] == 0 && k_[3] == 0;
    if (radial_only && !(radius <= max_distorted_radius_)) return {Status::kOutsideValidRadius, Eigen::Vector3d::UnitZ()};
    const double start = InvertRadial(formula_, k_, std::min(radius, max_distorted_radius_), valid_radius_);
    if (radius > 0) ab *= start / radius;
    const bool solved = RefineUndistorted(px, &ab);
    if (ab.squaredNorm() > valid_radius_squared_) return {Status::kOutsideValidRadius, Eigen::Vector3d::UnitZ()};
    if (!solved) {
      const bool beyond = !(radius <= max_distorted_radius_);
      return {beyond ? Status::kOutsideValidRadius : Status::kNotConverged, Eigen::Vector3d::UnitZ()};
    }
  }
  return {Status::kOk, Eigen::Vector3d(ab[0], ab[1], 1).stableNormalized()};
}

/// Newton's method on both coordinates; every step is halved until the residual falls. True when the residual ends below its
/// limit on the sheet that holds the image centre (positive Jacobian determinant).
bool Projector::RefineUndistorted(const Eigen::Vector2d& px, Eigen::Vector2d* ab) const {
  const double limit = ResidualLimit(px, cx_, cy_);
  Eigen::Matrix2d jacobian;
  const auto residual_at = [&](const Eigen::Vector2d& at) -> Eigen::Vector2d {
    const Eigen::Vector2d distorted = Distort(at[0], at[1], &jacobian);
    return {fx_ * distorted[0] + cx_ - px[0], fy_ * distorted[1] + cy_ - px[1]};
  };
  Eigen::Vector2d residual = residual_at(*ab);
  for (int i = 0; i < 50 && residual.norm() > 0.01 * limit; ++i) {
    const Eigen::Vector2d scaled(residual[0] / fx_, residual[1] / fy_);
    const Eigen::Vector2d step = jacobian.inverse() * scaled;
    double damping = 1;
    Eigen::Vector2d next, next_residual;
    do {
      next = *ab - damping * step;
      next_residual = residual_at(next);
      damping *= 0.5;
    } while (!(next_residual.norm() < residual.norm()) && damping > 1e-6);
    if (!(next_residual.norm() < residual.norm())) break;
    *ab = next;
    residual = next_residual;
  }
  residual = residual_at(*ab);
  return residual.norm() <= limit && jacobian.determinant() >= 0;
}

Projection Project(const Camera& camera, const Eigen::Vector3d& x_in_cam) { return Projector(camera).Project(x_in_cam); }
Unprojection Unproject(const Camera& camera, const Eigen::Vector2d& px) { return Projector(camera).Unproject(px); }
double ValidRadius(const Camera& camera) { return Projector(camera).valid_radius(); }

}  // namespace mvstudio::geometry
