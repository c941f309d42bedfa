#include <algorithm>
#include <cmath>
#include <limits>

#include "avatar/body/mesh_raster.h"
#include "core/format.h"
#include "tests/splats/scenes.h"
#include "tests/support/digits.h"
#include "tests/support/mp.h"
#include "tests/support/test.h"

/// Digits of drawn bodies (float) and of drawn Gaussians (float and double).
namespace mvstudio {
namespace {

using splats::Splat;
using Vector3mp = Eigen::Matrix<Mp, 3, 1>;

const char* const kMpfr = "MPFR, 120 digits";

DigitsCase Case(const std::string& what, const std::string& conditions, const std::string& oracle) {
  return {"Drawing", what, conditions, oracle};
}

constexpr int kWidth = 48, kHeight = 40;

geometry::RigCamera CameraOf(double focal_px) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("cam", kWidth, kHeight, focal_px);
  return camera;
}

/// One triangle that fills most of the image, its corners at other depths.
body::BodyTemplate Triangle(double depth_m, double focal_px, uint64_t seed) {
  Rng rng(seed);
  body::BodyTemplate mesh;
  mesh.vertices.resize(3, 3);
  const double px[3][2] = {{2, 3}, {45, 9}, {17, 38}};
  for (int k = 0; k < 3; ++k) {
    const double z = depth_m * rng.Uniform(0.7, 1.4);
    mesh.vertices.col(k) = Eigen::Vector3d((px[k][0] - 23.5) / focal_px * z, (px[k][1] - 19.5) / focal_px * z, z).cast<float>();
  }
  mesh.faces.resize(3, 1);
  mesh.faces.col(0) << 0, 1, 2;
  mesh.face_part = {1};
  mesh.face_uv.resize(2, 3);
  mesh.face_uv << 0, 1, 0, 0, 0, 1;
  return mesh;
}

struct MeshErrors {
  WorstError depth, shares;
  int covered = 0, wrong = 0;
};

/// Against the ray through each pixel's centre and the triangle in space; pixels within 1e-6 of an edge are left out.
MeshErrors CompareMesh(const body::BodyTemplate& mesh, const geometry::RigCamera& camera) {
  const body::PartUvMap map = body::RasterizeBody(mesh, mesh.vertices, camera);
  const body::FaceMap faces = body::RasterizeFaces(mesh, mesh.vertices, camera);
  Vector3mp v[3];
  for (int k = 0; k < 3; ++k) v[k] = mesh.vertices.col(k).cast<Mp>();
  const Vector3mp normal = (v[1] - v[0]).cross(Vector3mp(v[2] - v[0]));
  MeshErrors errors;
  for (int p = 0; p < kWidth * kHeight; ++p) {
    const geometry::Camera& lens = camera.camera;
    const Vector3mp ray((Mp(p % kWidth) - Mp(lens.cx())) / Mp(lens.fx()), (Mp(p / kWidth) - Mp(lens.cy())) / Mp(lens.fy()),
                        Mp(1));
    Vector3mp shares;
    for (int k = 0; k < 3; ++k) shares[k] = ray.dot(v[(k + 1) % 3].cross(v[(k + 2) % 3]));
    shares /= Mp(shares.sum());
    const Mp least = shares.minCoeff(), depth = v[0].dot(normal) / ray.dot(normal);
    if (abs(least) < Mp(1e-6)) continue;
    const auto at = static_cast<size_t>(p);
    errors.wrong += (map.part[at] > 0) != (least > 0);
    if (!(least > 0) || map.part[at] == 0) continue;
    ++errors.covered;
    errors.depth.Add(static_cast<double>(Mp(map.depth_m[at]) / depth - 1));
    errors.shares.Add(static_cast<double>((faces.barycentric[at].cast<Mp>() - shares).norm()));
  }
  return errors;
}

TEST(ImageDigits, Meshes) {
  for (const double depth : {1e-3, 2.0, 1e6}) {
    for (const double focal : {1.0, 50.0, 1e6}) {
      const MeshErrors errors = CompareMesh(Triangle(depth, focal, 3), CameraOf(focal));
      const std::string where = Format("%g m away, f = %g px, single precision", depth, focal);
      EXPECT_GT(errors.covered, 500) << where;
      RecordStatus(Case("pixels of a triangle", where, kMpfr), "0 wrong", Format("%d wrong", errors.wrong));
      RecordDigits(Case("depth", where, kMpfr), 6, errors.depth.value());
      RecordDigits(Case("place on the triangle", where, kMpfr), 6, errors.shares.value());
    }
  }
}

TEST(ImageDigits, MeshesThatCannotBeDrawn) {
  const auto covered = [](float bad) {
    body::BodyTemplate mesh = Triangle(2, 50, 3);
    mesh.vertices(2, 1) = bad;
    const body::PartUvMap map = body::RasterizeBody(mesh, mesh.vertices, CameraOf(50));
    return Format("%d pixels",
                  static_cast<int>(std::count_if(map.part.begin(), map.part.end(), [](uint8_t p) { return p > 0; })));
  };
  for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity(), -1.f, 0.f}) {
    RecordStatus(Case("triangle", Format("a corner's depth is %g", bad), "definition"), "0 pixels", covered(bad));
  }
}

/// Colour and coverage of a pixel, and whether rounding decides something there.
struct ExactPixel {
  Mp values[4] = {0, 0, 0, 0};
  bool sure = true;
};

template <class S>
ExactPixel Blend(const std::vector<Splat<S>>& sorted, int x, int y) {
  ExactPixel out;
  Mp through = 1;
  for (const Splat<S>& s : sorted) {
    const Mp dx = Mp(x) - Mp(s.x), dy = Mp(y) - Mp(s.y);
    Mp alpha = Mp(s.opacity) * exp(-(Mp(s.a) * dx * dx + Mp(s.c) * dy * dy) / 2 - Mp(s.b) * dx * dy);
    out.sure = out.sure && abs(alpha / splats::kLeastAlpha - 1) > 1e-5 && abs(through / splats::kFullPixel - 1) > 1e-3;
    if (alpha < splats::kLeastAlpha || through <= splats::kFullPixel) continue;
    alpha = std::min(alpha, Mp(splats::kMostAlpha));
    for (int c = 0; c < 3; ++c) out.values[c] += through * alpha * Mp(s.rgb[c]);
    through *= 1 - alpha;
  }
  out.values[3] = 1 - through;
  return out;
}

/// Every pixel looks at every Gaussian, in numbers of 120 digits; errors as shares of full coverage.
template <class S>
double WorstPixel(const splats::testing::Drawn<S>& drawn, int* compared) {
  std::vector<Splat<S>> sorted = drawn.projected.splats;
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.depth < b.depth; });
  WorstError worst;
  for (int y = 0; y < drawn.image.height; y += 2) {
    for (int x = 0; x < drawn.image.width; x += 2) {
      const ExactPixel exact = Blend(sorted, x, y);
      if (!exact.sure) continue;
      ++*compared;
      const size_t at = static_cast<size_t>(y) * static_cast<size_t>(drawn.image.width) + static_cast<size_t>(x);
      for (int c = 0; c < 4; ++c) worst.Add(static_cast<double>(Mp(drawn.image.Plane(c)[at]) - exact.values[c]));
    }
  }
  return worst.value();
}

TEST(ImageDigits, BlendedGaussians) {
  for (const size_t count : {size_t{1}, size_t{300}}) {
    splats::testing::Scene scene = splats::testing::RandomScene(count, 1, 2, 61, 43);
    for (double& value : scene.cloud.values.opacity) value += 2;
    int compared = 0;
    const std::string where = Format("n = %d, 61x43", static_cast<int>(count));
    RecordDigits(Case("blended colours, double", where, kMpfr), 13, WorstPixel(splats::testing::Draw(scene), &compared));
    const Eigen::Matrix3Xf vertices = scene.vertices.cast<float>();
    const auto in_float = splats::testing::Draw<float>(splats::CloudCast<float>(scene.cloud), {scene.faces, vertices},
                                                       splats::ViewOf<float>(scene.camera), {});
    RecordDigits(Case("blended colours, single precision", where, kMpfr), 4, WorstPixel(in_float, &compared));
    EXPECT_GT(compared, 500);
  }
}

/// The middle of a Gaussian on the axis: sigmoid of the logit, times what the filter of 0.1 px^2 keeps.
TEST(ImageDigits, AGaussianOnTheAxis) {
  for (const double depth : {0.06, 2.0, 100.0}) {
    splats::testing::Scene scene = splats::testing::FacingScene(33, {{16, 16, depth}}, 0.03 * depth);  // 3 px
    scene.cloud.values.opacity[0] = 0.7;
    const Mp expected = 1 / (1 + exp(-Mp(0.7))) * 9 / (9 + Mp("0.1"));
    const auto drawn = splats::testing::Draw(scene);
    RecordDigits(Case("coverage at the middle of a Gaussian, double", Format("%g m away", depth), "closed form"), 10,
                 static_cast<double>(Mp(drawn.image.Plane(3)[16 * 33 + 16]) / expected - 1));
  }
}

TEST(ImageDigits, GaussiansAtTheEnds) {
  const auto with = [](double log_scale, double logit, double z) {
    splats::testing::Scene scene = splats::testing::FacingScene(33, {{16, 16, z}}, 0.1);
    for (double& value : scene.cloud.values.log_scale) value = log_scale;
    scene.cloud.values.opacity[0] = logit;
    return splats::testing::Draw(scene);
  };
  const auto middle = [&](double log_scale, double logit) { return with(log_scale, logit, 2).image.Plane(3)[16 * 33 + 16]; };
  RecordDigits(Case("coverage, double", "a scale of exp(1e4) m, logit 2", "closed form"), 3,
               middle(1e4, 2) * (1 + std::exp(-2.0)) - 1);
  RecordDigits(Case("coverage, double", "a logit of 1e300", "the limit, 0.99"), 15, middle(-2, 1e300) / splats::kMostAlpha - 1);
  const auto word = [](const splats::testing::Drawn<double>& d) {
    const auto& skipped = d.projected.skipped;
    return Format("%d drawn, %lld not finite, %lld behind", static_cast<int>(d.projected.splats.size()),
                  static_cast<long long>(skipped.not_finite), static_cast<long long>(skipped.behind_camera));
  };
  const char* const definition = "definition";
  RecordStatus(Case("a Gaussian", "a scale of exp(-1e4) m", definition), "0 drawn, 0 not finite, 0 behind",
               word(with(-1e4, 2, 2)));
  RecordStatus(Case("a Gaussian", "a logit of -1e300", definition), "0 drawn, 0 not finite, 0 behind",
               word(with(-2, -1e300, 2)));
  RecordStatus(Case("a Gaussian", "a logit of NaN", definition), "0 drawn, 1 not finite, 0 behind",
               word(with(-2, std::nan(""), 2)));
  RecordStatus(Case("a Gaussian", "0.049 m away", definition), "0 drawn, 0 not finite, 1 behind", word(with(-2, 2, 0.049)));
}

}  // namespace
}  // namespace mvstudio
