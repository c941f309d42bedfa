#include "geometry/lens/lens_derivatives.h"

#include <cmath>

#include "geometry/lens/camera_model.h"
#include "geometry/lens/spline_grid.h"

namespace mvstudio::geometry {
namespace {

using Matrix23 = Eigen::Matrix<double, 2, 3>;

/// Image-plane coordinates m of a point and their derivatives: by the point, and by the distortion parameters in the columns
/// 4 … of LensDerivatives::d_px (null when nobody asks).
struct PlanePoint {
  double a = 0, b = 0;
  Matrix23 by_x;
};

/// Brown, rational and thin-prism models with `kCount` distortion parameters; the formulas stand in camera_model.h.
template <int kCount>
bool OnPlaneBrown(const double* k, const Eigen::Vector3d& x, PlanePoint* point, LensDerivatives* derivatives) {
  if (!(x[2] > 0)) return false;
  const double w = 1 / x[2], a = x[0] / x[2], b = x[1] / x[2];
  if constexpr (kCount == 0) {
    point->a = a, point->b = b;
    if (derivatives) point->by_x << w, 0, -a * w, 0, w, -b * w;
    return true;
  }
  const double s = a * a + b * b;
  double numerator = k[0], d_numerator = 0;  // of 1 + s * numerator
  if constexpr (kCount >= 5) numerator += s * (k[1] + s * k[4]), d_numerator = k[1] + s * 2 * k[4];
  if constexpr (kCount == 2 || kCount == 4) numerator += s * k[1], d_numerator = k[1];
  const double n = 1 + s * numerator, dn = numerator + s * d_numerator;
  double inverse_d = 1, radial = n, slope = dn;
  if constexpr (kCount >= 8) {
    inverse_d = 1 / (1 + s * (k[5] + s * (k[6] + s * k[7])));
    radial = n * inverse_d;
    slope = (dn - radial * (k[5] + s * (2 * k[6] + s * 3 * k[7]))) * inverse_d;
  }
  point->a = a * radial, point->b = b * radial;
  if constexpr (kCount >= 4) {
    point->a += 2 * k[2] * a * b + k[3] * (s + 2 * a * a);
    point->b += k[2] * (s + 2 * b * b) + 2 * k[3] * a * b;
  }
  if constexpr (kCount >= 12) {
    point->a += s * (k[8] + s * k[9]);
    point->b += s * (k[10] + s * k[11]);
  }
  if (!derivatives) return true;
  double da_a = radial + 2 * a * a * slope, db_b = radial + 2 * b * b * slope, da_b = 2 * a * b * slope;
  if constexpr (kCount >= 4) {
    da_a += 2 * k[2] * b + 6 * k[3] * a;
    db_b += 6 * k[2] * b + 2 * k[3] * a;
    da_b += 2 * (k[2] * a + k[3] * b);
  }
  double db_a = da_b;
  if constexpr (kCount >= 12) {
    const double to_a = 2 * (k[8] + 2 * s * k[9]), to_b = 2 * (k[10] + 2 * s * k[11]);
    da_a += to_a * a, da_b += to_a * b, db_a += to_b * a, db_b += to_b * b;
  }
  point->by_x << da_a * w, da_b * w, -(da_a * a + da_b * b) * w, db_a * w, db_b * w, -(db_a * a + db_b * b) * w;
  auto& by_k = derivatives->d_px;
  const double a_n = a * inverse_d, b_n = b * inverse_d;
  by_k.col(4) << a_n * s, b_n * s;
  if constexpr (kCount >= 2) by_k.col(5) << a_n * s * s, b_n * s * s;
  if constexpr (kCount >= 4) {
    by_k.col(6) << 2 * a * b, s + 2 * b * b;
    by_k.col(7) << s + 2 * a * a, 2 * a * b;
  }
  if constexpr (kCount >= 5) by_k.col(8) << a_n * s * s * s, b_n * s * s * s;
  if constexpr (kCount >= 8) {
    double power = -radial * s;
    for (int i = 9; i < 12; ++i, power *= s) by_k.col(i) << a_n * power, b_n * power;
  }
  if constexpr (kCount >= 12) by_k.middleCols<4>(12) << s, s * s, 0, 0, 0, 0, s, s * s;
  return true;
}

bool OnPlaneKannalaBrandt(const double* k, const Eigen::Vector3d& x, PlanePoint* point, LensDerivatives* derivatives) {
  const double side2 = x[0] * x[0] + x[1] * x[1];
  if (!(side2 > 0)) {
    if (!(x[2] > 0)) return false;
    const double w = 1 / x[2];
    point->a = x[0] * w, point->b = x[1] * w;
    if (!derivatives) return true;
    point->by_x << w, 0, 0, 0, w, 0;
    derivatives->d_px.middleCols<4>(4).setZero();
    return true;
  }
  const double side = std::sqrt(side2), inverse = 1 / side, theta = std::atan2(side, x[2]), t2 = theta * theta;
  const double radius = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
  const double c = x[0] * inverse, d = x[1] * inverse;
  point->a = c * radius, point->b = d * radius;
  if (!derivatives) return true;
  const double slope = 1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])));
  const double by_theta = slope / (side2 + x[2] * x[2]), across = radius * inverse, rest = by_theta * x[2] - across;
  point->by_x << across + rest * c * c, rest * c * d, -c * by_theta * side, rest * c * d, across + rest * d * d,
      -d * by_theta * side;
  double power = theta * t2;
  for (int i = 4; i < 8; ++i, power *= t2) derivatives->d_px.col(i) << c * power, d * power;
  return true;
}

/// brown1_p is brown4 with k2 = 0.
bool OnPlaneBrown1P(const double* k, const Eigen::Vector3d& x, PlanePoint* point, LensDerivatives* derivatives) {
  const double k4[4] = {k[0], 0, k[1], k[2]};
  if (!OnPlaneBrown<4>(k4, x, point, derivatives)) return false;
  if (derivatives) {
    derivatives->d_px.col(5) = derivatives->d_px.col(6);
    derivatives->d_px.col(6) = derivatives->d_px.col(7);
  }
  return true;
}

/// The denominator D of (a, b) = (x, y) / D: its derivatives by x and y are `by_xy` times x and y.
struct Denominator {
  double value, by_xy, by_z, by_k[2];
};

bool UcmDenominator(const double* k, const Eigen::Vector3d& x, Denominator* result) {
  const double s = x[0] * x[0] + x[1] * x[1], d = std::sqrt(s + x[2] * x[2]), e = k[0] / d;
  *result = {SphereDenominator(k[0], 1.0, s, x[2], d), e, 1 + e * x[2], {d, 0}};
  return d > 0;
}

bool EucmDenominator(const double* k, const Eigen::Vector3d& x, Denominator* result) {
  const double s = x[0] * x[0] + x[1] * x[1], d2 = k[1] * s + x[2] * x[2];
  if (!(d2 > 0)) return false;
  const double d = std::sqrt(d2), e = k[0] / d;
  *result = {SphereDenominator(k[0], 1 - k[0], k[1] * s, x[2], d), e * k[1], e * x[2] + 1 - k[0], {d - x[2], 0.5 * e * s}};
  return true;
}

bool DoubleSphereDenominator(const double* k, const Eigen::Vector3d& x, Denominator* result) {
  const double s = x[0] * x[0] + x[1] * x[1], d1 = std::sqrt(s + x[2] * x[2]), shifted = x[2] + k[0] * d1;
  const double d2 = std::sqrt(s + shifted * shifted);
  if (!(d1 > 0 && d2 > 0)) return false;
  const double by_shifted = k[1] * shifted / d2 + 1 - k[1], e = k[0] / d1;
  *result = {SphereDenominator(k[1], 1 - k[1], s, shifted, d2),
             k[1] / d2 + by_shifted * e,
             by_shifted * (1 + e * x[2]),
             {by_shifted * d1, d2 - shifted}};
  return true;
}

/// `kCount` is the number of parameters of the denominator.
template <int kCount, class Function>
bool OnPlaneSphere(Function function, const double* k, const Eigen::Vector3d& x, PlanePoint* point,
                   LensDerivatives* derivatives) {
  Denominator d;
  if (!function(k, x, &d) || !(d.value > 0)) return false;
  const double w = 1 / d.value, a = x[0] * w, b = x[1] * w;
  point->a = a, point->b = b;
  if (!derivatives) return true;
  const double ex = d.by_xy * x[0], ey = d.by_xy * x[1];
  point->by_x << w * (1 - a * ex), -w * a * ey, -w * a * d.by_z, -w * b * ex, w * (1 - b * ey), -w * b * d.by_z;
  for (int i = 0; i < kCount; ++i) derivatives->d_px.col(4 + i) << -a * w * d.by_k[i], -b * w * d.by_k[i];
  return true;
}

/// Brown's decentring on top of a plane point; p1 and p2 are the parameters `column` and column + 1.
void Decentre(const double* p, int column, PlanePoint* point, LensDerivatives* derivatives) {
  const double a = point->a, b = point->b, s = a * a + b * b;
  point->a += 2 * p[0] * a * b + p[1] * (s + 2 * a * a);
  point->b += p[0] * (s + 2 * b * b) + 2 * p[1] * a * b;
  if (!derivatives) return;
  const double cross = 2 * (p[0] * a + p[1] * b);
  Eigen::Matrix2d jacobian;
  jacobian << 1 + 2 * p[0] * b + 6 * p[1] * a, cross, cross, 1 + 6 * p[0] * b + 2 * p[1] * a;
  point->by_x = (jacobian * point->by_x).eval();
  auto& by_k = derivatives->d_px;
  for (int i = 4; i < column; ++i) by_k.col(i) = (jacobian * by_k.col(i)).eval();
  by_k.col(column) << 2 * a * b, s + 2 * b * b;
  by_k.col(column + 1) << s + 2 * a * a, 2 * a * b;
}

bool OnPlaneSplined(const Camera& camera, const Eigen::Vector3d& x, PlanePoint* point, LensDerivatives* derivatives) {
  const double s = x[0] * x[0] + x[1] * x[1], d = std::sqrt(s + x[2] * x[2]);
  const double denominator = SphereDenominator(1.0, 1.0, s, x[2], d);
  if (!(denominator > 0)) return false;
  const double q = 2 / denominator;
  const Eigen::Vector2d u(x[0] * q, x[1] * q);
  const SplineGrid& grid = camera.spline;
  const SplineSample sample = SampleSpline(grid, camera.params.data() + 4, u);
  point->a = u[0] + sample.offset[0], point->b = u[1] + sample.offset[1];
  if (!derivatives) return true;
  const double e = -0.5 * q * q / d;
  Matrix23 u_by_x;
  u_by_x << q + e * x[0] * x[0], e * x[0] * x[1], e * x[0] * (x[2] + d), e * x[0] * x[1], q + e * x[1] * x[1],
      e * x[1] * (x[2] + d);
  point->by_x = u_by_x + sample.d_offset_d_u * u_by_x;
  int count = 4;
  for (int j = 0; j <= grid.order; ++j) {
    const int first = 4 + 2 * ((sample.row + j) * grid.cols + sample.col);
    for (int i = 0; i <= grid.order; ++i, count += 2) {
      const double weight = sample.weights_y[j] * sample.weights_x[i];
      derivatives->columns[count] = first + 2 * i, derivatives->columns[count + 1] = first + 2 * i + 1;
      derivatives->d_px.middleCols<2>(count) << weight, 0, 0, weight;
    }
  }
  derivatives->count = count;
  return true;
}

/// All models with a fixed number of parameters and without decentring of their own kind.
bool OnPlaneRadial(LensModel model, const double* k, const Eigen::Vector3d& x, PlanePoint* point,
                   LensDerivatives* derivatives) {
  switch (model) {
    case LensModel::kBrown1:
      return OnPlaneBrown<1>(k, x, point, derivatives);
    case LensModel::kBrown2:
      return OnPlaneBrown<2>(k, x, point, derivatives);
    case LensModel::kBrown4:
      return OnPlaneBrown<4>(k, x, point, derivatives);
    case LensModel::kBrown5:
      return OnPlaneBrown<5>(k, x, point, derivatives);
    case LensModel::kRational8:
      return OnPlaneBrown<8>(k, x, point, derivatives);
    case LensModel::kThinPrism12:
      return OnPlaneBrown<12>(k, x, point, derivatives);
    case LensModel::kBrown1P:
      return OnPlaneBrown1P(k, x, point, derivatives);
    case LensModel::kKannalaBrandt4:
    case LensModel::kKannalaBrandt4P:
      return OnPlaneKannalaBrandt(k, x, point, derivatives);
    case LensModel::kUcm:
    case LensModel::kUcmP:
      return OnPlaneSphere<1>(UcmDenominator, k, x, point, derivatives);
    case LensModel::kEucm:
    case LensModel::kEucmP:
      return OnPlaneSphere<2>(EucmDenominator, k, x, point, derivatives);
    case LensModel::kDoubleSphere:
    case LensModel::kDoubleSphereP:
      return OnPlaneSphere<2>(DoubleSphereDenominator, k, x, point, derivatives);
    default:
      return OnPlaneBrown<0>(k, x, point, derivatives);
  }
}

/// The column of p1 where Decentre has to add it, or 0.
int DecentringColumn(LensModel model) {
  switch (model) {
    case LensModel::kPinholeP:
      return 4;
    case LensModel::kUcmP:
      return 5;
    case LensModel::kEucmP:
    case LensModel::kDoubleSphereP:
      return 6;
    case LensModel::kKannalaBrandt4P:
      return 8;
    default:
      return 0;
  }
}

}  // namespace

bool ProjectLens(const Camera& camera, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* px, LensDerivatives* derivatives) {
  const double* p = camera.params.data();
  PlanePoint point;
  if (camera.model == LensModel::kSplined) {
    if (!OnPlaneSplined(camera, x_in_cam, &point, derivatives)) return false;
  } else {
    if (!OnPlaneRadial(camera.model, p + 4, x_in_cam, &point, derivatives)) return false;
    if (const int column = DecentringColumn(camera.model)) Decentre(p + column, column, &point, derivatives);
  }
  *px << p[0] * point.a + p[2], p[1] * point.b + p[3];
  if (!px->allFinite()) return false;
  if (!derivatives) return true;
  if (camera.model != LensModel::kSplined) {
    derivatives->count = static_cast<int>(camera.params.size());
    for (int i = 4; i < derivatives->count; ++i) derivatives->columns[i] = i;
  }
  for (int i = 0; i < 4; ++i) derivatives->columns[i] = i;
  auto& d_px = derivatives->d_px;
  d_px.leftCols<4>() << point.a, 0, 1, 0, 0, point.b, 0, 1;
  for (int i = 4; i < derivatives->count; ++i) d_px(0, i) *= p[0], d_px(1, i) *= p[1];
  derivatives->d_px_d_x_in_cam.row(0) = p[0] * point.by_x.row(0);
  derivatives->d_px_d_x_in_cam.row(1) = p[1] * point.by_x.row(1);
  return true;
}

}  // namespace mvstudio::geometry
