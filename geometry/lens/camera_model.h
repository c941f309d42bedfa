#pragma once

#include <Eigen/Core>

#include "geometry/lens/models.h"

namespace mvstudio::geometry {

/// Projects x_in_cam by the formula alone, over any scalar (double, float, long double, numbers of many digits): returns false
/// only where it is undefined (z <= 0 for the perspective models; the origin and the negative optical axis for kannala4 and
/// splined; D <= 0). Does not know the valid radius: use Projector, or ProjectLens in optimisers, which evaluate the same
/// formulas in double. `grid` is used by the splined model only.
template <class T>
bool ProjectByFormula(LensModel model, const T* params, const Eigen::Matrix<T, 3, 1>& x_in_cam, Eigen::Matrix<T, 2, 1>* px,
                      const SplineGrid& grid = {}) {
  T a, b;
  if (!internal::VisitLens(model, grid, [&](auto lens) { return lens.Project(params + 4, x_in_cam, &a, &b); })) return false;
  (*px)[0] = params[0] * a + params[2];
  (*px)[1] = params[1] * b + params[3];
  return true;
}

}  // namespace mvstudio::geometry
