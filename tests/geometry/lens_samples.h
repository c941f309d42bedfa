#pragma once

#include <string>
#include <vector>

#include "geometry/camera.h"
#include "geometry/camera_model.h"

/// Lenses shared by the tests of geometry/, and the projection formula in long double as their oracle.
namespace mvstudio::geometry::testing {

inline Camera MakeLens(LensModel model, const std::vector<double>& distortion, int width = 1280, int height = 960,
                       double focal = 900) {
  Camera camera = MakePinhole(std::string(ToString(model)), width, height, focal);
  camera.model = model;
  Eigen::VectorXd params(NumParams(model));
  params.head<4>() << focal, 1.002 * focal, 0.5 * width + 7.3, 0.5 * height - 4.9;
  for (size_t i = 0; i < distortion.size(); ++i) params[4 + static_cast<Eigen::Index>(i)] = distortion[i];
  camera.params = params;
  return camera;
}

/// One ordinary lens of every model.
inline std::vector<Camera> OrdinaryLenses() {
  return {MakeLens(LensModel::kPinhole, {}),
          MakeLens(LensModel::kBrown1, {-0.12}),
          MakeLens(LensModel::kBrown2, {-0.28, 0.09}),
          MakeLens(LensModel::kBrown4, {-0.28, 0.09, 0.0011, -0.0017}),
          MakeLens(LensModel::kBrown5, {-0.266, -0.0386, 0.00178, -0.00028, 0.238}),
          MakeLens(LensModel::kRational8, {0.41, 0.12, 4e-4, -3e-4, 0.004, 0.72, 0.21, 0.018}),
          MakeLens(LensModel::kKannalaBrandt4, {0.021, -0.0083, 0.0019, -0.0004}, 1280, 960, 420)};
}

/// Strong barrel, pincushion, folding, and polar lenses.
inline std::vector<Camera> ExtremeLenses() {
  return {MakeLens(LensModel::kBrown1, {0.5}),
          MakeLens(LensModel::kBrown1, {-0.4}),
          MakeLens(LensModel::kBrown5, {-0.35, 0.15, 0, 0, -0.03}),
          MakeLens(LensModel::kBrown5, {-0.35, 0.15, 0.004, -0.006, -0.03}),
          MakeLens(LensModel::kBrown4, {0.5, 0.2, 0.01, -0.02}),
          MakeLens(LensModel::kRational8, {0, 0, 0, 0, 0, -1, 0, 0}),
          MakeLens(LensModel::kRational8, {18.3, 9.2, 1e-4, -2e-4, 0.5, 18.8, 14.1, 2.1}),
          MakeLens(LensModel::kKannalaBrandt4, {0, 0, 0, 0}, 1280, 960, 300),
          MakeLens(LensModel::kKannalaBrandt4, {-0.2, 0.01, 0, 0}, 1280, 960, 300)};
}

using Vector2ld = Eigen::Matrix<long double, 2, 1>;
using Vector3ld = Eigen::Matrix<long double, 3, 1>;
using VectorXld = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

inline Vector2ld ProjectLong(LensModel model, const VectorXld& params, const Vector3ld& x) {
  Vector2ld px(0, 0);
  ProjectByFormula<long double>(model, params.data(), x, &px);
  return px;
}

inline Vector2ld ProjectLong(const Camera& camera, const Eigen::Vector3d& x) {
  return ProjectLong(camera.model, camera.params.cast<long double>(), x.cast<long double>());
}

/// A direction whose radius (tan theta, or theta for kannala4) is `radius`, at the azimuth `phi`.
inline Eigen::Vector3d Direction(LensModel model, double radius, double phi) {
  if (model == LensModel::kKannalaBrandt4) {
    return {std::sin(radius) * std::cos(phi), std::sin(radius) * std::sin(phi), std::cos(radius)};
  }
  return {radius * std::cos(phi), radius * std::sin(phi), 1};
}

}  // namespace mvstudio::geometry::testing
