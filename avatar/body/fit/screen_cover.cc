#include "avatar/body/fit/screen_cover.h"

#include <algorithm>
#include <cmath>

#include "geometry/lens/camera.h"

namespace mvstudio::body {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

/// Columns of row y between the edges of a triangle.
void FillRow(const Vector2d corners[3], int y, Image* cover) {
  double low = cover->width, high = -1;
  for (int k = 0; k < 3; ++k) {
    const bool rises = corners[k][1] <= corners[(k + 1) % 3][1];  // both faces of an edge round it alike: no gap between them
    const Vector2d &a = corners[rises ? k : (k + 1) % 3], &b = corners[rises ? (k + 1) % 3 : k];
    if (b[1] < y || a[1] > y) continue;
    if (a[1] == b[1]) {
      low = std::min({low, a[0], b[0]}), high = std::max({high, a[0], b[0]});
      continue;
    }
    const double x = a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
    low = std::min(low, x), high = std::max(high, x);
  }
  const int x0 = static_cast<int>(std::ceil(std::max(low, 0.0)));
  const int x1 = static_cast<int>(std::floor(std::min<double>(high, cover->width - 1)));
  if (x1 >= x0) std::fill_n(cover->Pixel(x0, y), x1 - x0 + 1, uint8_t{255});
}

}  // namespace

ScreenVertices ProjectVertices(const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& camera) {
  const geometry::Projector projector(camera.camera);
  const Eigen::Matrix3d rotation = camera.cam_from_world.rotation.toRotationMatrix();
  ScreenVertices screen{Eigen::Matrix2Xd::Zero(2, vertices_in_world.cols()), std::vector<uint8_t>(vertices_in_world.cols(), 0)};
  for (Eigen::Index i = 0; i < vertices_in_world.cols(); ++i) {
    const Vector3d x = rotation * vertices_in_world.col(i).cast<double>() + camera.cam_from_world.translation;
    if (!(x[2] > 1e-6)) continue;
    const geometry::Projection projection = projector.Project(x);
    if (projection.status != Status::kOk) continue;
    screen.px.col(i) = projection.px, screen.seen[i] = 1;
  }
  return screen;
}

Image FillFaces(const Eigen::Matrix3Xi& faces, const ScreenVertices& screen, int width_px, int height_px) {
  Image cover(width_px, height_px, 1);
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    const Eigen::Vector3i face = faces.col(f);
    if (!screen.seen[face[0]] || !screen.seen[face[1]] || !screen.seen[face[2]]) continue;
    const Vector2d corners[3] = {screen.px.col(face[0]), screen.px.col(face[1]), screen.px.col(face[2])};
    const auto [low, high] = std::minmax({corners[0][1], corners[1][1], corners[2][1]});
    const int y1 = static_cast<int>(std::floor(std::min(high, height_px - 1.0)));
    for (int y = static_cast<int>(std::ceil(std::max(low, 0.0))); y <= y1; ++y) FillRow(corners, y, &cover);
  }
  return cover;
}

}  // namespace mvstudio::body
