#include "geometry/lens/lens_derivatives.h"

#include "geometry/lens/models.h"

namespace mvstudio::geometry {

bool ProjectLens(const Camera& camera, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* px, LensDerivatives* derivatives) {
  const double* p = camera.params.data();
  internal::PlanePoint point;
  const bool defined = internal::VisitLens(camera.model, camera.spline, [&](auto lens) {
    return lens.ProjectWithDerivatives(p + 4, x_in_cam, &point, derivatives);
  });
  if (!defined) return false;
  *px << p[0] * point.a + p[2], p[1] * point.b + p[3];
  if (!px->allFinite()) return false;
  if (!derivatives) return true;
  if (!TraitsOf(camera.model).has_grid) {
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
