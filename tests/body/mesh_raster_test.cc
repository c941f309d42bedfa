#include "avatar/body/mesh_raster.h"

#include <cmath>

#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

geometry::RigCamera Camera(int width = 64, int height = 48, double focal = 50) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("cam", width, height, focal);
  return camera;
}

/// Triangles with given corners (world = cam), part k + 1 each, uv (0,0), (1,0), (0,1).
BodyTemplate Triangles(const std::vector<Eigen::Matrix3f>& corners) {
  BodyTemplate body;
  body.vertices.resize(3, 3 * corners.size());
  body.faces.resize(3, corners.size());
  body.face_uv.resize(2, 3 * corners.size());
  for (size_t f = 0; f < corners.size(); ++f) {
    body.vertices.middleCols<3>(3 * f) = corners[f];
    body.faces.col(f) = Eigen::Vector3i(3 * f, 3 * f + 1, 3 * f + 2);
    body.face_part.push_back(static_cast<int>(f) + 1);
    body.face_uv.middleCols<3>(3 * f) << 0, 1, 0, 0, 0, 1;
  }
  return body;
}

Eigen::Matrix3f Corners(Eigen::Vector3f a, Eigen::Vector3f b, Eigen::Vector3f c) {
  Eigen::Matrix3f m;
  m << a, b, c;
  return m;
}

TEST(RasterizeBody, SlantedTriangleAgreesWithRayIntersection) {
  const Eigen::Matrix3f corners = Corners({-0.9f, -0.7f, 2}, {1.5f, -0.5f, 4}, {-0.2f, 1.1f, 3});
  const geometry::RigCamera camera = Camera();
  const BodyTemplate body = Triangles({corners});
  const PartUvMap map = RasterizeBody(body, body.vertices, camera);
  int inside = 0;
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const Eigen::Vector3d ray((x - camera.camera.cx()) / 50, (y - camera.camera.cy()) / 50, 1);
      Eigen::Matrix3d m;
      m << (corners.col(1) - corners.col(0)).cast<double>(), (corners.col(2) - corners.col(0)).cast<double>(), -ray;
      const Eigen::Vector3d uvt = m.inverse() * -corners.col(0).cast<double>();
      const double margin = std::min({uvt[0], uvt[1], 1 - uvt[0] - uvt[1]});
      if (std::abs(margin) < 1e-6) continue;
      const size_t at = static_cast<size_t>(y) * map.width + x;
      EXPECT_EQ(map.part[at], margin > 0 ? 1 : 0) << x << "," << y;
      if (margin <= 0) {
        EXPECT_TRUE(std::isinf(map.depth_m[at]));
        continue;
      }
      ++inside;
      EXPECT_NEAR(map.u[at], uvt[0], 1e-5);
      EXPECT_NEAR(map.v[at], uvt[1], 1e-5);
      EXPECT_NEAR(map.depth_m[at], uvt[2], 1e-5);
    }
  }
  EXPECT_GT(inside, 300);
}

TEST(RasterizeBody, NearerFaceWinsWhateverTheOrder) {
  const Eigen::Matrix3f near = Corners({-1, -1, 2}, {1, -1, 2}, {0, 1, 2}), far = Corners({-2, -2, 3}, {2, -2, 3}, {0, 2, 3});
  for (const auto& faces : {std::vector<Eigen::Matrix3f>{near, far}, {far, near}}) {
    const BodyTemplate body = Triangles(faces);
    const PartUvMap map = RasterizeBody(body, body.vertices, Camera());
    EXPECT_FLOAT_EQ(map.depth_m[24 * 64 + 32], 2.f);
    EXPECT_EQ(map.part[24 * 64 + 32], faces[0] == near ? 1 : 2);
  }
}

TEST(RasterizeBody, SharedEdgesLeaveNoHoles) {
  const Eigen::Vector3f a(-0.8f, -0.6f, 2), b(0.8f, -0.6f, 2), c(0.8f, 0.6f, 2), d(-0.8f, 0.6f, 2), m(0.013f, 0.021f, 2);
  const BodyTemplate body = Triangles({Corners(a, b, m), Corners(b, c, m), Corners(c, d, m), Corners(d, a, m)});
  const PartUvMap map = RasterizeBody(body, body.vertices, Camera());
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      const bool inside = std::abs(x - 31.5) < 20 && std::abs(y - 23.5) < 15;
      EXPECT_EQ(map.part[y * 64 + x] > 0, inside) << x << "," << y;
    }
  }
}

TEST(RasterizeBody, FacesBehindTheCameraAndOutsideTheImageAreSkipped) {
  const BodyTemplate body =
      Triangles({Corners({-1, -1, -2}, {1, -1, 2}, {0, 1, 2}), Corners({50, 0, 2}, {51, 0, 2}, {50, 1, 2}),
                 Corners({0, 0, 2}, {0, 0, 2}, {1, 1, 2}), Corners({NAN, 0, 2}, {0, 0, 2}, {1, 1, 2})});
  const PartUvMap map = RasterizeBody(body, body.vertices, Camera());
  for (uint8_t part : map.part) EXPECT_EQ(part, 0);
}

TEST(RasterizeBody, GoesThroughTheLens) {
  geometry::RigCamera camera = Camera(200, 150, 150);
  camera.camera.model = geometry::LensModel::kBrown5;
  camera.camera.params.conservativeResize(9);
  camera.camera.params.tail<5>() << -0.2, 0.05, 0.001, -0.001, 0;
  const Eigen::Vector3f at(0.5f, 0.3f, 1.f);
  const BodyTemplate body = Triangles(
      {Corners(at + Eigen::Vector3f(-.02f, -.02f, 0), at + Eigen::Vector3f(.02f, -.02f, 0), at + Eigen::Vector3f(0, .03f, 0))});
  const PartUvMap map = RasterizeBody(body, body.vertices, camera);
  const geometry::Projection expected = geometry::Project(camera.camera, at.cast<double>());
  EXPECT_EQ(map.part[std::lround(expected.px[1]) * 200 + std::lround(expected.px[0])], 1);
}

TEST(RasterizeBody, MannequinFillsAPlausibleSilhouette) {
  const BodyTemplate body = MakeMannequin();
  geometry::RigCamera camera = Camera(640, 480, 600);
  Eigen::Matrix3d rotation;  // looking along +y from y = -3, z = 0.9
  rotation << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  camera.cam_from_world.rotation = Eigen::Quaterniond(rotation);
  camera.cam_from_world.translation = -(rotation * Eigen::Vector3d(0, -3, 0.9));
  const PartUvMap map = RasterizeBody(body, body.vertices, camera);
  int area = 0;
  for (uint8_t part : map.part) area += part > 0;
  EXPECT_GT(area, 18000);
  EXPECT_LT(area, 40000);
  for (int j = 0; j < 19; ++j) {
    const Eigen::Vector2d px = geometry::Project(camera.camera, camera.cam_from_world * Eigen::Vector3d(body.coco19.col(j))).px;
    EXPECT_GT(map.part[std::lround(px[1]) * 640 + std::lround(px[0])], 0) << "joint " << j;
  }
}

}  // namespace
}  // namespace mvstudio::body
