#include "avatar/body/fit/rim.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "avatar/body/fit/screen_cover.h"
#include "avatar/body/surface_nets.h"
#include "geometry/lens/camera.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

double Cross(const Vector2d& a, const Vector2d& b) { return a[0] * b[1] - a[1] * b[0]; }

/// 1: a face of the vertex looks at the camera, 2: one looks away, 3: both. 0 without an image.
std::vector<uint8_t> Facings(const Eigen::Matrix3Xi& faces, const ScreenVertices& screen) {
  std::vector<uint8_t> facing(screen.seen.size(), 0);
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    const Eigen::Vector3i face = faces.col(f);
    if (!screen.seen[face[0]] || !screen.seen[face[1]] || !screen.seen[face[2]]) continue;
    const Vector2d a = screen.px.col(face[0]);
    const double area = Cross(screen.px.col(face[1]) - a, screen.px.col(face[2]) - a);
    for (int k = 0; k < 3; ++k)
      facing[face[k]] |= area < 0 ? 1 : 2;  // y of images points down: counter-clockwise turns negative
  }
  return facing;
}

bool Covered(const Image& cover, const Vector2d& px) {
  const int x = static_cast<int>(std::lround(px[0])), y = static_cast<int>(std::lround(px[1]));
  return x >= 0 && y >= 0 && x < cover.width && y<cover.height&& * cover.Pixel(x, y)> 0;
}

/// True where the outline of the whole body runs: nothing of it lies further out.
bool OnOutline(const Image& cover, const Vector2d& px, const Vector2d& outward) {
  for (const double out : {1.5, 3.0, 5.0}) {
    if (Covered(cover, px + out * outward)) return false;
  }
  return true;
}

bool WellInside(const Vector2d& px, const geometry::Camera& camera) {
  constexpr double kMargin = 4;
  return px.minCoeff() >= kMargin && px[0] <= camera.width_px - 1 - kMargin && px[1] <= camera.height_px - 1 - kMargin;
}

}  // namespace

Image RasterizeCover(const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& vertices_in_world,
                     const geometry::RigCamera& camera) {
  return FillFaces(faces, ProjectVertices(vertices_in_world, camera), camera.camera.width_px, camera.camera.height_px);
}

std::vector<RimPoint> FindRim(const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& vertices_in_world,
                              const geometry::RigCamera& camera) {
  const ScreenVertices screen = ProjectVertices(vertices_in_world, camera);
  const Image cover = FillFaces(faces, screen, camera.camera.width_px, camera.camera.height_px);
  const std::vector<uint8_t> facing = Facings(faces, screen);
  const Eigen::Matrix3Xf normals = VertexNormals(vertices_in_world, faces);
  const geometry::Projector projector(camera.camera);
  const Eigen::Matrix3d rotation = camera.cam_from_world.rotation.toRotationMatrix();
  std::vector<RimPoint> rim;
  for (Eigen::Index i = 0; i < vertices_in_world.cols(); ++i) {
    const Vector2d px = screen.px.col(i);
    if (facing[i] != 3 || !WellInside(px, camera.camera)) continue;
    const Vector3d x = rotation * vertices_in_world.col(i).cast<double>() + camera.cam_from_world.translation;
    const Eigen::Matrix<double, 2, 3> d_px_d_x = projector.ProjectWithJacobians(x).d_px_d_x * rotation;
    const Vector2d out = d_px_d_x * normals.col(i).cast<double>();
    if (!(out.norm() > 1e-9)) continue;
    const RimPoint point{static_cast<int>(i), px, out.normalized(), out.normalized().transpose() * d_px_d_x};
    if (OnOutline(cover, px, point.outward)) rim.push_back(point);
  }
  return rim;
}

}  // namespace mvstudio::body
