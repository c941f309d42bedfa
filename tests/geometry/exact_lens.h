#pragma once

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "geometry/lens/camera_model.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/mp.h"

/// The projection formulas in numbers of 60 digits, and their inverse by Newton's method: the oracle of geometry/'s lenses.
namespace mvstudio::geometry::testing {

using mvstudio::testing::Mp;
using Vector2mp = Eigen::Matrix<Mp, 2, 1>;
using Vector3mp = Eigen::Matrix<Mp, 3, 1>;
using VectorXmp = Eigen::Matrix<Mp, Eigen::Dynamic, 1>;

inline Vector2mp ProjectExactly(const Camera& camera, const VectorXmp& params, const Vector3mp& x) {
  Vector2mp px(Mp(0), Mp(0));
  ProjectByFormula<Mp>(camera.model, params.data(), x, &px, camera.spline);
  return px;
}

inline Vector2mp ProjectExactly(const Camera& camera, const Vector3mp& x) {
  return ProjectExactly(camera, camera.params.cast<Mp>(), x);
}

inline Vector2mp ProjectExactly(const Camera& camera, const Eigen::Vector3d& x) {
  return ProjectExactly(camera, x.cast<Mp>().eval());
}

/// The radial function at `radius` (tan theta, or theta for wide models); 0 where the formula is undefined.
template <class T>
T Radial(const Camera& camera, const T& radius) {
  using std::cos;
  using std::sin;
  Eigen::Matrix<T, Eigen::Dynamic, 1> params = camera.params.cast<T>();
  params.template head<4>() << T(1), T(1), T(0), T(0);
  const std::vector<std::string> names = ParamNames(camera);
  for (size_t i = 4; i < names.size(); ++i) {
    if (names[i][0] == 'p' || names[i][0] == 's') params[static_cast<Eigen::Index>(i)] = T(0);
  }
  const bool wide = IsWide(camera.model);
  const Eigen::Matrix<T, 3, 1> x(wide ? T(sin(radius)) : radius, T(0), wide ? T(cos(radius)) : T(1));
  Eigen::Matrix<T, 2, 1> px(T(0), T(0));
  ProjectByFormula<T>(camera.model, params.data(), x, &px, camera.spline);
  return px[0];
}

/// Slope of the radial function by differences of 1e-22, right to 30 digits.
inline Mp RadialSlope(const Camera& camera, const Mp& radius) {
  const Mp h("1e-22");
  return (Radial<Mp>(camera, radius + h) - Radial<Mp>(camera, radius - h)) / (2 * h);
}

/// Root of f in [low, high] by bisection to 55 digits.
template <class Function>
Mp Root(const Function& f, Mp low, Mp high) {
  const bool sign = f(low) > 0;
  for (int i = 0; i < 190; ++i) {
    const Mp mid = (low + high) / 2;
    ((f(mid) > 0) == sign ? low : high) = mid;
  }
  return low;
}

/// The ray of a pixel, and how far a ray moves the pixel there.
struct ExactRay {
  bool found = false;
  Vector3mp ray;                           ///< unit length
  Eigen::Matrix<Mp, 2, 2> d_px_d_tangent;  ///< with respect to the ray's turn about two axes across it, px a radian
};

/// Newton's method on two coordinates in the plane across the ray, from `start`; derivatives by differences of 1e-22. Found
/// when the pixel is reached to 1e-40 px.
inline ExactRay UnprojectExactly(const Camera& camera, const Eigen::Vector2d& px, const Eigen::Vector3d& start) {
  const Mp h("1e-22");
  const VectorXmp params = camera.params.cast<Mp>();
  const Vector2mp target = px.cast<Mp>();
  ExactRay result;
  result.ray = start.cast<Mp>().normalized();
  for (int step = 0; step < 60; ++step) {
    const Vector3mp ray = result.ray;
    Eigen::Matrix<Mp, 3, 2> across;
    across.col(0) =
        ray.cross(abs(ray[0]) < Mp(0.6) ? Vector3mp(Vector3mp::UnitX()) : Vector3mp(Vector3mp::UnitY())).normalized();
    across.col(1) = ray.cross(Vector3mp(across.col(0)));
    for (int j = 0; j < 2; ++j) {
      const Vector3mp turn = across.col(j) * h;
      result.d_px_d_tangent.col(j) =
          (ProjectExactly(camera, params, ray + turn) - ProjectExactly(camera, params, ray - turn)) / (2 * h);
    }
    const Vector2mp residual = ProjectExactly(camera, params, ray) - target;
    if (residual.norm() < Mp("1e-40") * (1 + target.norm())) {
      result.found = true;
      return result;
    }
    const Vector2mp turn = result.d_px_d_tangent.inverse() * residual;
    result.ray = (ray - across * turn).normalized();
  }
  return result;
}

}  // namespace mvstudio::geometry::testing
