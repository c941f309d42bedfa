#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "geometry/lens/camera.h"

/// Lenses shared by the tests of geometry/; exact_lens.h has the oracle of their projections.
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

/// A splined lens whose control points wave by `amplitude`.
inline Camera MakeSplined(const SplineGrid& grid, double amplitude, double focal = 500, int width = 1280, int height = 960) {
  Camera camera = MakePinhole("splined" + std::to_string(grid.order), width, height, focal);
  camera.model = LensModel::kSplined;
  camera.spline = grid;
  camera.params.resize(NumParams(camera));
  camera.params.head<4>() << focal, 1.002 * focal, 0.5 * width + 7.3, 0.5 * height - 4.9;
  for (int i = 4; i < camera.params.size(); ++i) camera.params[i] = amplitude * std::sin(1.7 * i + 0.3 * i * i);
  return camera;
}

/// One ordinary lens of every model, in the order of LensModel; two splined ones.
inline std::vector<Camera> OrdinaryLenses() {
  return {MakeLens(LensModel::kPinhole, {}),
          MakeLens(LensModel::kBrown1, {-0.12}),
          MakeLens(LensModel::kBrown2, {-0.28, 0.09}),
          MakeLens(LensModel::kBrown4, {-0.28, 0.09, 0.0011, -0.0017}),
          MakeLens(LensModel::kBrown5, {-0.266, -0.0386, 0.00178, -0.00028, 0.238}),
          MakeLens(LensModel::kRational8, {0.41, 0.12, 4e-4, -3e-4, 0.004, 0.72, 0.21, 0.018}),
          MakeLens(LensModel::kKannalaBrandt4, {0.021, -0.0083, 0.0019, -0.0004}, 1280, 960, 420),
          MakeLens(LensModel::kThinPrism12, {0.41, 0.12, 4e-4, -3e-4, 0.004, 0.72, 0.21, 0.018, 1e-3, -2e-4, -8e-4, 3e-4}),
          MakeLens(LensModel::kUcm, {1.2}),
          MakeLens(LensModel::kEucm, {0.6, 1.1}, 1280, 960, 420),
          MakeLens(LensModel::kDoubleSphere, {-0.2, 0.55}, 1280, 960, 420),
          MakeLens(LensModel::kPinholeP, {0.0011, -0.0017}),
          MakeLens(LensModel::kBrown1P, {-0.12, 0.0011, -0.0017}),
          MakeLens(LensModel::kKannalaBrandt4P, {0.021, -0.0083, 0.0019, -0.0004, -0.0007, 0.0012}, 1280, 960, 420),
          MakeLens(LensModel::kUcmP, {1.2, 0.003, -0.002}),
          MakeLens(LensModel::kEucmP, {0.6, 1.1, 0.001, -0.002}, 1280, 960, 420),
          MakeLens(LensModel::kDoubleSphereP, {-0.2, 0.55, -0.001, 0.002}, 1280, 960, 420),
          MakeSplined({3, 11, 10, 150}, 0.01),
          MakeSplined({2, 11, 10, 150}, 0.01)};
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
          MakeLens(LensModel::kKannalaBrandt4, {-0.2, 0.01, 0, 0}, 1280, 960, 300),
          MakeLens(LensModel::kThinPrism12, {0.41, 0.12, 0.004, -0.003, 0.004, 0.72, 0.21, 0.018, 0.01, -0.002, -0.008, 0.003}),
          MakeLens(LensModel::kUcm, {2.5}),
          MakeLens(LensModel::kUcm, {1}, 1280, 960, 300),
          MakeLens(LensModel::kUcm, {0.3}, 1280, 960, 300),
          MakeLens(LensModel::kUcm, {-0.4}, 1280, 960, 300),
          MakeLens(LensModel::kEucm, {0.8, 0.5}, 1280, 960, 300),
          MakeLens(LensModel::kEucm, {0.5, 1}, 1280, 960, 300),
          MakeLens(LensModel::kEucm, {0.3, 2}, 1280, 960, 300),
          MakeLens(LensModel::kEucm, {-0.2, 0.7}, 1280, 960, 300),
          MakeLens(LensModel::kEucm, {1.3, 1.2}, 1280, 960, 900),
          MakeLens(LensModel::kDoubleSphere, {0.6, 0.7}, 1280, 960, 500),
          MakeLens(LensModel::kDoubleSphere, {-0.5, 0.3}, 1280, 960, 300),
          MakeLens(LensModel::kDoubleSphere, {1.5, 0.4}, 1280, 960, 900),
          MakeLens(LensModel::kDoubleSphere, {1, 0.5}, 1280, 960, 500),
          MakeLens(LensModel::kPinholeP, {0.02, -0.03}),
          MakeLens(LensModel::kKannalaBrandt4P, {-0.05, 0.004, 0, 0, 0.01, -0.02}, 1280, 960, 300),
          MakeLens(LensModel::kUcmP, {1.5, 0.03, -0.02}, 1280, 960, 1100),
          MakeLens(LensModel::kEucmP, {0.7, 0.9, 0.02, -0.01}, 1280, 960, 400),
          MakeLens(LensModel::kDoubleSphereP, {0.4, 0.6, -0.02, 0.01}, 1280, 960, 600)};
}

/// A direction whose radius (tan theta, or theta for wide models) is `radius`, at the azimuth `phi`.
inline Eigen::Vector3d Direction(LensModel model, double radius, double phi) {
  if (IsWide(model)) return {std::sin(radius) * std::cos(phi), std::sin(radius) * std::sin(phi), std::cos(radius)};
  return {radius * std::cos(phi), radius * std::sin(phi), 1};
}

/// True when the lens has no decentring and no prism terms that are not zero.
inline bool IsRadial(const Camera& camera) {
  if (camera.model == LensModel::kSplined) return false;
  const std::vector<std::string> names = ParamNames(camera);
  for (size_t i = 4; i < names.size(); ++i) {
    if (names[i][0] != 'k' && (names[i][0] == 'p' || names[i][0] == 's') && camera.params[static_cast<Eigen::Index>(i)] != 0) {
      return false;
    }
  }
  return true;
}

/// A radius well inside what the lens can see and far from its folds.
inline double Reach(const Camera& camera) {
  return std::min(0.9 * ValidRadius(camera), !IsWide(camera.model) ? 0.8 : IsRadial(camera) ? 2.5 : 0.9);
}

inline std::vector<Camera> AllLenses() {
  std::vector<Camera> lenses = OrdinaryLenses();
  for (const Camera& camera : ExtremeLenses()) lenses.push_back(camera);
  return lenses;
}

}  // namespace mvstudio::geometry::testing

namespace mvstudio::geometry {
using namespace testing;
}
