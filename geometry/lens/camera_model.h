#pragma once

#include <Eigen/Core>
#include <cmath>

#include "geometry/lens/camera.h"
#include "geometry/lens/spline_grid.h"

/// The projection formulas, once, over any scalar (double, float, long double, ceres::Jet). All models give image-plane
/// coordinates (a', b') and then u = fx a' + cx, v = fy b' + cy. Perspective models: D. C. Brown, "Decentering distortion of
/// lenses", 1966, in OpenCV's parametrisation; with a = x/z, b = y/z, r2 = a^2 + b^2:
///   L  = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
///   a' = a L + 2 p1 a b + p2 (r2 + 2 a^2) + s1 r2 + s2 r2^2,   b' = b L + p1 (r2 + 2 b^2) + 2 p2 a b + s3 r2 + s4 r2^2.
/// Wide models: (a, b) = (x, y) / D with d = |(x, y, z)| and
///   kannala4      D = |(x, y)| / theta_d(theta), theta = atan2(|(x, y)|, z)   (Kannala and Brandt, PAMI 2006, radial part)
///   ucm           D = z + xi d                                               (Mei and Rives, ICRA 2007)
///   eucm          D = alpha sqrt(beta (x^2 + y^2) + z^2) + (1 - alpha) z     (Khomutenko et al., RA-L 2016)
///   doublesphere  D = alpha |(x, y, z + xi d)| + (1 - alpha) (z + xi d)      (Usenko et al., 3DV 2018)
///   splined       D = (d + z) / 2, then (a', b') = (a, b) + du(a, b), see spline_grid.h
/// Variants "_p" put Brown's p1, p2 on top: a' = a + 2 p1 a b + p2 (r2 + 2 a^2), b' = b + p1 (r2 + 2 b^2) + 2 p2 a b.
namespace mvstudio::geometry {

/// Decentring of image-plane coordinates, added to (a_out, b_out).
template <class T>
void AddDecentring(const T& p1, const T& p2, const T& a, const T& b, T* a_out, T* b_out) {
  const T r2 = a * a + b * b;
  *a_out = *a_out + T(2) * p1 * a * b + p2 * (r2 + T(2) * a * a);
  *b_out = *b_out + p1 * (r2 + T(2) * b * b) + T(2) * p2 * a * b;
}

/// Distortion of normalised coordinates (a, b) by a perspective model. `k` are the distortion parameters of `model`.
/// The outputs must not be the inputs' own variables.
template <class T>
void DistortNormalized(LensModel model, const T* k, const T& a, const T& b, T* a_out, T* b_out) {
  *a_out = a, *b_out = b;
  if (model == LensModel::kPinhole) return;
  if (model == LensModel::kPinholeP) return AddDecentring(k[0], k[1], a, b, a_out, b_out);
  const int n = NumDistortionParams(model);
  const bool short_p = model == LensModel::kBrown1P;
  const T zero(0), r2 = a * a + b * b;
  const T k2 = n > 1 && !short_p ? k[1] : zero, k3 = n > 4 ? k[4] : zero;
  T radial = T(1) + r2 * (k[0] + r2 * (k2 + r2 * k3));
  if (n >= 8) radial = radial / (T(1) + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  *a_out = a * radial, *b_out = b * radial;
  if (short_p) AddDecentring(k[1], k[2], a, b, a_out, b_out);
  if (n >= 4) AddDecentring(k[2], k[3], a, b, a_out, b_out);
  if (n < 12) return;
  *a_out = *a_out + r2 * (k[8] + r2 * k[9]);
  *b_out = *b_out + r2 * (k[10] + r2 * k[11]);
}

/// theta_d of the Kannala-Brandt model.
template <class T>
T KannalaBrandtRadius(const T* k, const T& theta) {
  const T t2 = theta * theta;
  return theta * (T(1) + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

/// p d + q z with d = sqrt(side2 + z^2), without cancellation where the two terms nearly do (rays straight behind the camera).
template <class T>
T SphereDenominator(const T& p, const T& q, const T& side2, const T& z, const T& d) {
  if (!(p > T(0) && q * z < T(0))) return p * d + q * z;
  return (p * p * side2 + (p - q) * (p + q) * z * z) / (p * d - q * z);
}

/// 1 / D of the wide models but the splined one. False where D <= 0 or D is undefined.
template <class T>
bool WideScale(LensModel model, const T* k, const Eigen::Matrix<T, 3, 1>& x, T* scale) {
  using std::atan2;
  using std::sqrt;
  const T s2 = x[0] * x[0] + x[1] * x[1], &z = x[2];
  if (model == LensModel::kKannalaBrandt4 || model == LensModel::kKannalaBrandt4P) {
    if (!(s2 > T(0))) {
      if (!(z > T(0))) return false;
      *scale = T(1) / z;  // the limit on the axis, with the right derivative
      return true;
    }
    const T s = sqrt(s2);
    *scale = KannalaBrandtRadius(k, T(atan2(s, z))) / s;
    return true;
  }
  const bool extended = model == LensModel::kEucm || model == LensModel::kEucmP;
  const T side2 = extended ? T(k[1] * s2) : s2, d2 = side2 + z * z, one(1);
  if (!(d2 > T(0))) return false;
  const T d = sqrt(d2);
  T denominator = extended ? SphereDenominator(k[0], T(one - k[0]), side2, z, d) : SphereDenominator(k[0], one, s2, z, d);
  if (model == LensModel::kDoubleSphere || model == LensModel::kDoubleSphereP) {
    const T shifted = z + k[0] * d, square = s2 + shifted * shifted;
    if (!(square > T(0))) return false;
    denominator = SphereDenominator(k[1], T(one - k[1]), s2, shifted, T(sqrt(square)));
  }
  if (!(denominator > T(0))) return false;
  *scale = T(1) / denominator;
  return true;
}

/// Image-plane coordinates of a splined lens; `control` are the parameters after fx, fy, cx, cy.
template <class T>
bool SplinedPlane(const SplineGrid& grid, const T* control, const Eigen::Matrix<T, 3, 1>& x, T* a, T* b) {
  using std::sqrt;
  const T s2 = x[0] * x[0] + x[1] * x[1];
  const T denominator = SphereDenominator(T(1), T(1), s2, x[2], T(sqrt(s2 + x[2] * x[2])));
  if (!(denominator > T(0))) return false;
  const Eigen::Matrix<T, 2, 1> u(T(2) * x[0] / denominator, T(2) * x[1] / denominator);
  const Eigen::Matrix<T, 2, 1> offset = SplineOffset(grid, control, u);
  *a = u[0] + offset[0], *b = u[1] + offset[1];
  return true;
}

/// Projects x_in_cam by the formula alone: returns false only where it is undefined (z <= 0 for the perspective models; the
/// origin and the negative optical axis for kannala4 and splined; D <= 0). Does not know the valid radius: use Projector
/// outside optimisers. `grid` is used by the splined model only.
template <class T>
bool ProjectByFormula(LensModel model, const T* params, const Eigen::Matrix<T, 3, 1>& x_in_cam, Eigen::Matrix<T, 2, 1>* px,
                      const SplineGrid& grid = {}) {
  T a, b;
  if (model == LensModel::kSplined) {
    if (!SplinedPlane(grid, params + 4, x_in_cam, &a, &b)) return false;
  } else if (!IsWide(model)) {
    if (!(x_in_cam[2] > T(0))) return false;
    DistortNormalized(model, params + 4, T(x_in_cam[0] / x_in_cam[2]), T(x_in_cam[1] / x_in_cam[2]), &a, &b);
  } else {
    T scale;
    if (!WideScale(model, params + 4, x_in_cam, &scale)) return false;
    const T a0 = x_in_cam[0] * scale, b0 = x_in_cam[1] * scale;
    a = a0, b = b0;
    const bool decentred = model == LensModel::kKannalaBrandt4P || model == LensModel::kUcmP || model == LensModel::kEucmP ||
                           model == LensModel::kDoubleSphereP;
    const T* p = params + NumParams(model) - 2;
    if (decentred) AddDecentring(p[0], p[1], a0, b0, &a, &b);
  }
  (*px)[0] = params[0] * a + params[2];
  (*px)[1] = params[1] * b + params[3];
  return true;
}

}  // namespace mvstudio::geometry
