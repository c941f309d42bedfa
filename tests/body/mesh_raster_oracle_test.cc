#include <cmath>

#include "avatar/body/fit/rim.h"
#include "avatar/body/mesh_raster.h"
#include "core/random.h"
#include "tests/body/plain_z_buffer.h"
#include "tests/support/test.h"

/// RasterizeBody and RasterizeCover beside a plain z-buffer, beside whole numbers, and where rounding would leave gaps.
namespace mvstudio::body {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

geometry::RigCamera PinholeAt(int width, int height, double focal, double cx, double cy) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("cam", width, height, focal);
  camera.camera.params[2] = cx, camera.camera.params[3] = cy;
  return camera;
}

/// Faces of three vertices each, parts 1 to 24 in turn.
BodyTemplate MeshOf(const Eigen::Matrix3Xf& vertices, const std::vector<Eigen::Vector3i>& faces) {
  BodyTemplate body;
  body.vertices = vertices;
  body.faces.resize(3, static_cast<Eigen::Index>(faces.size()));
  body.face_uv.resize(2, 3 * body.faces.cols());
  for (size_t f = 0; f < faces.size(); ++f) {
    body.faces.col(static_cast<Eigen::Index>(f)) = faces[f];
    body.face_part.push_back(static_cast<int>(f % kNumParts) + 1);
    body.face_uv.middleCols<3>(3 * static_cast<Eigen::Index>(f)) << 0, 1, 0, 0, 0, 1;
  }
  return body;
}

struct Agreement {
  int compared = 0, seen = 0;
};

/// Every pixel where rounding decides nothing is the plain z-buffer's; the silhouette as well.
Agreement ExpectPlain(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices, const geometry::RigCamera& camera) {
  const PartUvMap map = RasterizeBody(body, vertices, camera);
  const Image cover = RasterizeCover(body.faces, vertices, camera);
  const std::vector<PlainPixel> plain = PlainZBuffer(body, vertices, camera);
  Agreement agreement;
  for (size_t p = 0; p < plain.size(); ++p) {
    if (!plain[p].IsSure()) continue;
    ++agreement.compared;
    const int face = plain[p].face, part = face < 0 ? 0 : body.face_part[static_cast<size_t>(face)];
    EXPECT_EQ(map.part[p], part) << p;
    EXPECT_EQ(cover.pixels[p] > 0, part > 0) << p;
    if (part == 0 || map.part[p] != part) continue;
    ++agreement.seen;
    EXPECT_NEAR(map.depth_m[p], plain[p].depth_m, 1e-6 * plain[p].depth_m) << p;
    Eigen::Vector2d uv = Eigen::Vector2d::Zero();
    for (int k = 0; k < 3; ++k) uv += plain[p].shares[k] * body.face_uv.col(3 * face + k).cast<double>();
    EXPECT_LT((Eigen::Vector2d(map.u[p], map.v[p]) - uv).cwiseAbs().maxCoeff(), 1e-5) << p;
  }
  return agreement;
}

/// Triangles of all sizes before, beside and behind the camera, some without an area, some with vertices that are no numbers.
BodyTemplate Soup(Rng* rng, int count) {
  Eigen::Matrix3Xf vertices(3, 3 * count);
  std::vector<Eigen::Vector3i> faces;
  for (int f = 0; f < count; ++f) {
    const Vector3f middle(static_cast<float>(rng->Uniform(-2, 2)), static_cast<float>(rng->Uniform(-2, 2)),
                          static_cast<float>(rng->Uniform(-1, 5)));
    const double size = std::pow(10.0, rng->Uniform(-3, 0.5));
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d away(rng->Normal(), rng->Normal(), rng->Normal());
      vertices.col(3 * f + k) = middle + (size * away).cast<float>();
    }
    if (f % 10 == 0) vertices.col(3 * f + 2) = vertices.col(3 * f);
    if (f % 10 == 1) vertices.col(3 * f + 2) = 0.5f * (vertices.col(3 * f) + vertices.col(3 * f + 1));
    if (f % 50 == 2) vertices(f % 3, 3 * f + f % 2) = f % 4 ? NAN : INFINITY;
    if (f % 50 == 3) vertices.col(3 * f) *= 1e30f;
    if (f % 50 == 4) vertices(2, 3 * f) = 2e-6f;
    faces.emplace_back(3 * f, 3 * f + 1, 3 * f + 2);
  }
  return MeshOf(vertices, faces);
}

TEST(RasterizeBodyBesidePlainZBuffer, TriangleSoups) {
  Rng rng(3);
  Agreement all;
  for (int trial = 0; trial < 40; ++trial) {
    const BodyTemplate body = Soup(&rng, 200);
    geometry::RigCamera camera = PinholeAt(48, 40, rng.Uniform(15, 120), rng.Uniform(0, 47), rng.Uniform(0, 39));
    if (trial > 0)
      camera.cam_from_world.rotation = Eigen::AngleAxisd(rng.Uniform(0, 3), Eigen::Vector3d(1, 2, -1).normalized());
    camera.cam_from_world.translation = 0.3 * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
    const Agreement one = ExpectPlain(body, body.vertices, camera);
    all.compared += one.compared, all.seen += one.seen;
  }
  EXPECT_GT(all.compared, 40 * 48 * 40 * 95 / 100);
  EXPECT_GT(all.seen, all.compared / 3);
}

TEST(RasterizeBodyBesidePlainZBuffer, Mannequin) {
  const BodyTemplate body = MakeMannequin(1.75, 0.5);
  for (const double turn : {0.0, 1.1, 2.9, 4.4}) {
    geometry::RigCamera camera = PinholeAt(160, 120, 110, 79.5, 60.25);
    camera.cam_from_world.rotation =
        Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ());
    camera.cam_from_world.translation = Eigen::Vector3d(0, 0.9, 2.2);
    EXPECT_GT(ExpectPlain(body, body.vertices, camera).seen, 1000) << turn;
  }
}

/// How many faces cover each pixel, every face drawn by itself.
std::vector<int> Covers(const BodyTemplate& body, const geometry::RigCamera& camera) {
  std::vector<int> covers(static_cast<size_t>(camera.camera.width_px) * static_cast<size_t>(camera.camera.height_px));
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    const PartUvMap map = RasterizeBody(MeshOf(body.vertices, {body.faces.col(f)}), body.vertices, camera);
    for (size_t p = 0; p < covers.size(); ++p) covers[p] += map.part[p] > 0;
  }
  return covers;
}

/// n x n quads, each cut along one diagonal or the other; vertices by `place(i, j)`.
template <class Place>
BodyTemplate Tessellation(int n, Rng* rng, const Place& place) {
  Eigen::Matrix3Xf vertices(3, (n + 1) * (n + 1));
  std::vector<Eigen::Vector3i> faces;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) vertices.col(j * (n + 1) + i) = place(i, j);
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i, b = a + 1, c = a + n + 2, d = a + n + 1;
      const bool first = rng->Uniform(0, 1) < 0.5;
      faces.push_back(first ? Eigen::Vector3i(a, b, c) : Eigen::Vector3i(a, b, d));
      faces.push_back(first ? Eigen::Vector3i(a, c, d) : Eigen::Vector3i(b, c, d));
    }
  }
  return MeshOf(vertices, faces);
}

TEST(RasterizeBodyIsWatertight, SlantedSquareOfRandomTriangles) {
  Rng rng(4);
  for (int trial = 0; trial < 10; ++trial) {
    const int n = 9;
    const BodyTemplate body = Tessellation(n, &rng, [&](int i, int j) {
      const bool rim = i == 0 || j == 0 || i == n || j == n;
      const double jitter = rim ? 0 : 0.2, u = (i + jitter * rng.Uniform(-1, 1)) / n - 0.5,
                   v = (j + jitter * rng.Uniform(-1, 1)) / n - 0.5;
      return Vector3f(Eigen::Vector3d(5 * u, 5 * v, 2 + 0.6 * u - 0.4 * v).cast<float>());
    });
    const geometry::RigCamera camera = PinholeAt(64, 48, 55, 31.3, 23.6);
    for (const int count : Covers(body, camera)) EXPECT_EQ(count, 1);
    const Image cover = RasterizeCover(body.faces, body.vertices, camera);
    EXPECT_EQ(std::count(cover.pixels.begin(), cover.pixels.end(), 255), 64 * 48);
  }
}

/// Vertices at multiples of half a pixel, many of them centres: integers say which centres a face covers, edges included.
TEST(RasterizeBodyIsWatertight, VerticesOnPixelCentres) {
  Rng rng(5);
  const geometry::RigCamera camera = PinholeAt(16, 12, 1, 0, 0);  // x / z is the pixel
  const auto whole = [&](int low, int high) { return static_cast<int>(std::floor(rng.Uniform(low, high + 1))); };
  for (int trial = 0; trial < 3000; ++trial) {
    Eigen::Matrix<int64_t, 2, 3> twice;  // pixels
    for (int k = 0; k < 6; ++k) twice(k % 2, k / 2) = whole(-6, 36);
    const auto z = static_cast<float>(1 << whole(0, 3));
    Eigen::Matrix3f vertices;
    vertices << 0.5f * z * twice.cast<float>(), Eigen::RowVector3f::Constant(z);
    const PartUvMap map = RasterizeBody(MeshOf(vertices, {{0, 1, 2}}), vertices, camera);
    for (int p = 0; p < 16 * 12; ++p) {
      const auto edge = [&](int k, int64_t x, int64_t y) {
        const auto a = twice.col(k), b = twice.col((k + 1) % 3);
        return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
      };
      const int64_t x = 2 * (p % 16), y = 2 * (p / 16), e0 = edge(0, x, y), e1 = edge(1, x, y), e2 = edge(2, x, y);
      const bool covered = e0 + e1 + e2 != 0 && ((e0 >= 0 && e1 >= 0 && e2 >= 0) || (e0 <= 0 && e1 <= 0 && e2 <= 0));
      ASSERT_EQ(map.part[static_cast<size_t>(p)] > 0, covered) << "trial " << trial << ", pixel " << p;
    }
  }
}

/// Two faces whose common edge runs through a pixel's centre but for the rounding of its ends.
TEST(RasterizeBodyIsWatertight, EdgesThroughPixelCentres) {
  Rng rng(6);
  for (int trial = 0; trial < 5000; ++trial) {
    const geometry::RigCamera camera = PinholeAt(8, 8, rng.Uniform(5, 50), 3, 4);
    const auto random = [&] { return static_cast<float>(rng.Uniform(-1, 1)); };
    const Vector3f a(random(), random(), 2 + random());
    const float back = std::exp2(std::floor(static_cast<float>(rng.Uniform(-2, 3))));
    const Vector3f b(-back * a[0], -back * a[1], a[2]), side(-a[1], a[0], 0);
    Eigen::Matrix3Xf vertices(3, 4);
    vertices << a, b, a + 2 * side, b - 3 * side;
    const BodyTemplate body = MeshOf(vertices, {{0, 1, 2}, {1, 0, 3}});
    EXPECT_GT(RasterizeBody(body, vertices, camera).part[4 * 8 + 3], 0) << trial;
    EXPECT_EQ(*RasterizeCover(body.faces, vertices, camera).Pixel(3, 4), 255) << trial;
  }
}

/// Faces around a vertex that lies a few roundings beside a pixel's centre.
TEST(RasterizeBodyIsWatertight, FansAroundPixelCentres) {
  Rng rng(7);
  const geometry::RigCamera camera = PinholeAt(4, 4, 37.7, 0, 0);
  for (int trial = 0; trial < 5000; ++trial) {
    const int count = 3 + trial % 6;
    Eigen::Matrix3Xf vertices(3, count + 1);
    const double off = std::pow(10.0, rng.Uniform(-20, -12)), start = rng.Uniform(0, 6);
    vertices.col(count) << static_cast<float>(off * rng.Normal()), static_cast<float>(off * rng.Normal()), 1;
    std::vector<Eigen::Vector3i> faces;
    for (int k = 0; k < count; ++k) {
      const double angle = start + (k + rng.Uniform(0, 0.4)) * 2 * M_PI / count, radius = rng.Uniform(1, 20);
      vertices.col(k) << static_cast<float>(radius * std::cos(angle)), static_cast<float>(radius * std::sin(angle)), 1;
      faces.emplace_back(k, (k + 1) % count, count);
    }
    EXPECT_GT(RasterizeBody(MeshOf(vertices, faces), vertices, camera).part[0], 0) << trial;
  }
}

}  // namespace
}  // namespace mvstudio::body
