#pragma once

#include <Eigen/Core>
#include <cmath>

#include "geometry/camera.h"

/// The projection formulas, once, over any scalar (double, float, ceres::Jet, mpreal).
/// Brown and rational: D. C. Brown, "Decentering distortion of lenses", 1966, in OpenCV's parametrisation; with a = x/z, b =
/// y/z, r2 = a^2 + b^2:
///   L  = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
///   a' = a L + 2 p1 a b + p2 (r2 + 2 a^2),   b' = b L + p1 (r2 + 2 b^2) + 2 p2 a b,   u = fx a' + cx,   v = fy b' + cy.
/// Kannala and Brandt, "A generic camera model and calibration method", PAMI 2006, radial part: theta = atan2(|(x,y)|, z).
namespace mvstudio::geometry {

/// Brown/rational distortion of normalised coordinates (a, b). `k` are the distortion parameters of `model`.
/// The outputs must not be the inputs' own variables.
template <class T>
void DistortNormalized(LensModel model, const T* k, const T& a, const T& b, T* a_out, T* b_out) {
  const T zero(0);
  const int n = NumDistortionParams(model);
  const T k1 = n > 0 ? k[0] : zero, k2 = n > 1 ? k[1] : zero;
  const T p1 = n > 2 ? k[2] : zero, p2 = n > 3 ? k[3] : zero, k3 = n > 4 ? k[4] : zero;
  const T r2 = a * a + b * b;
  T radial = T(1) + r2 * (k1 + r2 * (k2 + r2 * k3));
  if (model == LensModel::kRational8) radial = radial / (T(1) + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  *a_out = a * radial + T(2) * p1 * a * b + p2 * (r2 + T(2) * a * a);
  *b_out = b * radial + p1 * (r2 + T(2) * b * b) + T(2) * p2 * a * b;
}

/// theta_d of the Kannala-Brandt model.
template <class T>
T KannalaBrandtRadius(const T* k, const T& theta) {
  const T t2 = theta * theta;
  return theta * (T(1) + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

/// Projects x_in_cam by the formula alone: returns false only where it is undefined (z <= 0 for the perspective models; the
/// origin and the negative optical axis for kannala4). Does not know the valid radius: use Projector outside optimisers.
template <class T>
bool ProjectByFormula(LensModel model, const T* params, const Eigen::Matrix<T, 3, 1>& x_in_cam, Eigen::Matrix<T, 2, 1>* px) {
  using std::atan2;
  using std::sqrt;
  const T &x = x_in_cam[0], &y = x_in_cam[1], &z = x_in_cam[2];
  T a, b;
  if (model == LensModel::kKannalaBrandt4) {
    const T s2 = x * x + y * y;
    if (!(s2 > T(0))) {
      if (!(z > T(0))) return false;
      a = x / z, b = y / z;  // the limit on the axis, with the right derivative
    } else {
      const T s = sqrt(s2);
      const T scale = KannalaBrandtRadius(params + 4, T(atan2(s, z))) / s;
      a = x * scale, b = y * scale;
    }
  } else {
    if (!(z > T(0))) return false;
    DistortNormalized(model, params + 4, T(x / z), T(y / z), &a, &b);
  }
  (*px)[0] = params[0] * a + params[2];
  (*px)[1] = params[1] * b + params[3];
  return true;
}

}  // namespace mvstudio::geometry
