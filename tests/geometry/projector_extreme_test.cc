#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "core/random.h"
#include "core/units.h"
#include "tests/geometry/exact_lens.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// The largest distorted radius: infinity where the radial function ends at a pole.
Mp FoldReach(const Camera& camera, double fold) {
  if (std::isinf(fold)) return kInfinity;
  const Mp before = Radial<Mp>(camera, fold * (1 - Mp("1e-10"))), at = Radial<Mp>(camera, fold);
  return before > 1e4 ? Mp(kInfinity) : before > at ? before : at;
}

TEST(ValidRadius, IsTheFoldOfThePolynomial) {
  const Camera camera = MakeLens(LensModel::kBrown5, {-0.35, 0.15, 0, 0, -0.03});
  const auto slope = [](const Mp& s) { return Mp(1 + s * (3 * Mp(-0.35) + s * (5 * Mp(0.15) + s * 7 * Mp(-0.03)))); };
  const Mp oracle = sqrt(Root(slope, 0, 3));
  EXPECT_NEAR(ValidRadius(camera), static_cast<double>(oracle), 4e-15);
}

TEST(ValidRadius, ClosedForms) {
  EXPECT_EQ(ValidRadius(MakePinhole("a", 10, 10, 10)), kInfinity);
  EXPECT_EQ(ValidRadius(MakeLens(LensModel::kBrown1, {0.5})), kInfinity);
  EXPECT_EQ(ValidRadius(MakeLens(LensModel::kBrown5, {0, 0, 0.1, 0.1, 0})), kInfinity);
  EXPECT_NEAR(ValidRadius(MakeLens(LensModel::kBrown1, {-0.4})), std::sqrt(1 / 1.2), 1e-15);
  // Tiny coefficients fold far out, but they do.
  EXPECT_NEAR(ValidRadius(MakeLens(LensModel::kBrown1, {-1e-12})) * std::sqrt(3e-12), 1, 1e-14);
  // k1 = 1, k2 = -5/9...: two folds, the first counts: 1 - 3 s + 2 s^2 = (1 - s)(1 - 2 s).
  EXPECT_NEAR(ValidRadius(MakeLens(LensModel::kBrown2, {-1, 0.4})), std::sqrt(0.5), 1e-14);
  // A double root, where the slope only touches zero: (1 - s)^2.
  EXPECT_NEAR(ValidRadius(MakeLens(LensModel::kBrown2, {-2.0 / 3, 0.2})), 1, 1e-7);
  // The pole of 1 / (1 - s), and the fold of r / (1 + s) at r = 1.
  EXPECT_NEAR(ValidRadius(MakeLens(LensModel::kRational8, {0, 0, 0, 0, 0, -1, 0, 0})), 1, 1e-15);
  EXPECT_NEAR(ValidRadius(MakeLens(LensModel::kRational8, {0, 0, 0, 0, 0, 1, 0, 0})), 1, 1e-15);
  EXPECT_EQ(ValidRadius(MakeLens(LensModel::kKannalaBrandt4, {0, 0, 0, 0})), kPi);
  EXPECT_NEAR(ValidRadius(MakeLens(LensModel::kKannalaBrandt4, {-0.1, 0, 0, 0})), std::sqrt(1 / 0.3), 1e-15);
}

/// The cones of the papers. Mei and Rives: a fold at cos(theta) = -1/xi for xi > 1, else a pole at -xi. Usenko et al., section
/// 4.3: z > -w sqrt(beta rho^2 + z^2) with w of alpha; for the double sphere the same with the second sphere's z and distance.
/// (The cone around the first sphere's centre that section 4.4 gives, w2 = (w + xi) / sqrt(2 w xi + xi^2 + 1), is another
/// one: for alpha = 1, rho / d2 is largest at cos(theta) = -xi.)
TEST(ValidRadius, ConesOfTheSphereModels) {
  for (const double xi : {-0.9, -0.3, 0.0, 0.4, 1.0}) {
    EXPECT_NEAR(ValidRadius(MakeLens(LensModel::kUcm, {xi})), std::acos(-xi), 1e-15) << xi;
  }
  for (const double xi : {1.1, 2.5, 40.0}) {
    EXPECT_NEAR(ValidRadius(MakeLens(LensModel::kUcm, {xi})), std::acos(-1 / xi), 1e-15) << xi;
  }
  for (const double alpha : {0.1, 0.4, 0.5, 0.55, 0.8, 1.0}) {
    const double w = alpha > 0.5 ? (1 - alpha) / alpha : alpha / (1 - alpha);
    for (const double beta : {0.5, 1.0, 1.7}) {
      // z = -w sqrt(beta rho^2 + z^2) on the cone, that is tan(theta) = sqrt((1 / w^2 - 1) / beta) past 90 degrees.
      const double cone = std::atan2(std::sqrt((1 - w * w) / beta), -w);
      EXPECT_NEAR(ValidRadius(MakeLens(LensModel::kEucm, {alpha, beta})), cone, 1e-14) << alpha << " " << beta;
    }
    for (const double xi : {-0.6, -0.2, 0.0, 0.3, 0.9}) {
      const double radius = ValidRadius(MakeLens(LensModel::kDoubleSphere, {xi, alpha})), z = std::cos(radius) + xi;
      EXPECT_NEAR(z / std::hypot(std::sin(radius), z), -w, 1e-14) << xi << " " << alpha;
    }
  }
}

TEST(ValidRadius, SphereModelsIncreaseUpToItAndNoFurther) {
  Rng rng(6);
  for (int i = 0; i < 900; ++i) {
    const LensModel model = i % 3 == 0 ? LensModel::kUcm : i % 3 == 1 ? LensModel::kEucm : LensModel::kDoubleSphere;
    std::vector<double> k = {rng.Uniform(-0.95, 3), 0};
    if (model == LensModel::kEucm) k = {rng.Uniform(-1, 2), rng.Uniform(0.1, 4)};
    if (model == LensModel::kDoubleSphere) k[1] = rng.Uniform(-0.5, 1.5);
    if (model == LensModel::kUcm) k.resize(1);
    const Camera camera = MakeLens(model, k);
    const double fold = ValidRadius(camera);
    long double last = 0;
    for (int j = 1; j < 400; ++j) {
      const long double value = Radial<long double>(camera, fold * j / 400.0L);
      ASSERT_GT(value, last) << ToString(model) << " " << k[0] << " folds before " << fold;
      last = value;
    }
    if (fold > kPi - 1e-6) continue;
    const long double before = Radial<long double>(camera, fold * (1 - 1e-5L)),
                      at = Radial<long double>(camera, fold * (1 - 1e-12L)),
                      after = Radial<long double>(camera, fold * (1 + 1e-4L));
    ASSERT_GE(at, before) << ToString(model) << " " << k[0];
    // A pole's other side has no formula, for which RadialLong gives 0.
    ASSERT_LT(after, at) << ToString(model) << " " << k[0] << " goes on rising beyond " << fold;
  }
}

TEST(ValidRadius, RandomLensesIncreaseUpToItAndNoFurther) {
  Rng rng(5);
  int folding = 0;
  for (int i = 0; i < 2000; ++i) {
    const LensModel model = i % 3 == 0 ? LensModel::kBrown5 : i % 3 == 1 ? LensModel::kRational8 : LensModel::kKannalaBrandt4;
    std::vector<double> k(NumDistortionParams(model));
    for (double& value : k) value = rng.Normal() * std::pow(10, rng.Uniform(-4, 1));
    if (model != LensModel::kKannalaBrandt4) k[2] = k[3] = 0;
    const Camera camera = MakeLens(model, k);
    const double fold = ValidRadius(camera), end = std::min(fold, 50.0);
    long double last = 0;
    for (int j = 1; j < 400; ++j) {
      const long double value = Radial<long double>(camera, end * j / 400.0L);
      ASSERT_GT(value, last) << "lens " << i << " folds before " << fold;
      last = value;
    }
    if (!(fold < 50) || fold == kPi) continue;
    ++folding;
    const long double before = Radial<long double>(camera, fold * (1 - 1e-7L)), at = Radial<long double>(camera, fold),
                      after = Radial<long double>(camera, fold * (1 + 1e-6L));
    // Beyond a fold the function falls; beyond a pole it jumps to the other sign.
    ASSERT_GE(at, before) << "lens " << i;
    ASSERT_LT(after, at) << "lens " << i << " goes on rising beyond " << fold;
  }
  EXPECT_GT(folding, 500);
}

TEST(Projector, RefusesToProjectBeyondTheFold) {
  for (const Camera& camera : testing::ExtremeLenses()) {
    const Projector projector(camera);
    const double fold = projector.valid_radius();
    if (std::isinf(fold) || fold == kPi) continue;
    for (const double phi : {0.0, 0.7, 2.1, 4.0}) {
      EXPECT_EQ(projector.Project(Direction(camera.model, fold * (1 - 1e-9), phi)).status, Status::kOk) << camera.name;
      EXPECT_EQ(projector.Project(Direction(camera.model, fold * (1 + 1e-9), phi)).status, Status::kOutsideValidRadius)
          << camera.name;
    }
  }
}

/// Where decentring and prism terms, quadratic on the image plane of wide lenses, are still far from folding it.
long double HarmlessRadius(const Camera& camera) {
  return IsWide(camera.model) || camera.model == LensModel::kThinPrism12 ? 1.0L : kInfinity;
}

TEST(Projector, InvertsExtremeLensesOrSaysWhyNot) {
  for (const Camera& camera : testing::ExtremeLenses()) {
    const Projector projector(camera);
    const bool radial_only = testing::IsRadial(camera);
    const double fold = projector.valid_radius();
    const Mp reach = FoldReach(camera, fold);
    int solved = 0;
    for (double v = -700; v < 1700; v += 47) {
      for (double u = -900; u < 2200; u += 53) {
        const Unprojection result = projector.Unproject({u, v});
        const long double radius = std::hypot((u - camera.cx()) / camera.fx(), (v - camera.cy()) / camera.fy());
        if (radial_only) {
          ASSERT_EQ(result.status, radius <= reach ? Status::kOk : Status::kOutsideValidRadius)
              << camera.name << " " << u << " " << v;
        } else if (radius < 0.9 * reach && radius < HarmlessRadius(camera)) {
          ASSERT_EQ(result.status, Status::kOk) << camera.name << " " << u << " " << v;
        }
        if (result.status != Status::kOk) continue;
        ++solved;
        ASSERT_LT((ProjectExactly(camera, result.ray_in_cam) - Vector2mp(u, v)).norm(), 1e-9L)
            << camera.name << " " << u << " " << v;
      }
    }
    EXPECT_GT(solved, 80) << camera.name;
  }
}

/// Walks along rays from the optical axis as far as the lens is not folded (Jacobian determinant of one sign): no pixel that a
/// walk comes to may be said to have no ray.
TEST(Projector, RefusesNoPixelThatARayReaches) {
  for (const Camera& camera : testing::ExtremeLenses()) {
    const Projector projector(camera);
    int reached = 0;
    for (double phi = 0; phi < 6.28; phi += 0.07) {
      const double end = std::min(projector.valid_radius(), IsWide(camera.model) ? kPi : 6.0);
      for (double radius = 0.01; radius < 0.999 * end; radius += 0.01) {
        const Eigen::Vector3d x = Direction(camera.model, radius, phi).normalized();
        const ProjectionWithJacobians at = projector.ProjectWithJacobians(x);
        if (at.status != Status::kOk) break;
        Eigen::Matrix3d with_ray;
        with_ray << at.d_px_d_x, x.transpose();
        if (!(with_ray.determinant() > 0.01 * camera.fx() * camera.fy())) break;
        ++reached;
        const Unprojection back = projector.Unproject(at.px);
        ASSERT_EQ(back.status, Status::kOk)
            << camera.name << " radius " << radius << " phi " << phi << ": " << at.px.transpose();
        ASSERT_LT((projector.Project(back.ray_in_cam).px - at.px).norm(), 2e-9 * std::max(1.0, at.px.norm() / 1e4))
            << camera.name << " radius " << radius << " phi " << phi;
      }
    }
    EXPECT_GT(reached, 1000) << camera.name;
  }
}

TEST(Projector, SplinesEndAtTheirGrid) {
  const Camera camera = testing::MakeSplined({3, 11, 10, 150}, 0.01);
  const Projector projector(camera);
  const double edge = DegToRad(75);
  EXPECT_NEAR(projector.valid_radius(), 2 * std::atan(std::tan(edge / 2) * 7 / 8), 1e-14);
  EXPECT_EQ(projector.Project({std::sin(edge - 1e-9), 0, std::cos(edge - 1e-9)}).status, Status::kOk);
  EXPECT_EQ(projector.Project({std::sin(edge + 1e-9), 0, std::cos(edge + 1e-9)}).status, Status::kOutsideValidRadius);
  EXPECT_EQ(projector.Project({0, 0, -1}).status, Status::kBehindCamera);
  for (const Eigen::Vector2d& px : {Eigen::Vector2d(-3000, 400), Eigen::Vector2d(640, 5000), Eigen::Vector2d(1e9, -1e9)}) {
    EXPECT_EQ(projector.Unproject(px).status, Status::kOutsideValidRadius);
  }
}

/// Control points so wild that the surface folds: what comes back is exact and on the side that is not folded.
TEST(Projector, FoldedSplinesGiveAStatusOrAnExactRay) {
  const Camera camera = testing::MakeSplined({3, 16, 12, 120}, 0.15);
  const Projector projector(camera);
  int folded = 0, solved = 0, refused = 0;
  for (double theta = 0.02; theta < 1; theta += 0.02) {
    for (double phi = 0; phi < 6.28; phi += 0.05) {
      const Projection there = projector.Project(Direction(camera.model, theta, phi));
      if (there.status != Status::kOk) {
        ++folded;
        continue;
      }
      const Unprojection back = projector.Unproject(there.px);
      ASSERT_EQ(back.status, Status::kOk) << theta << " " << phi;
      const Projection again = projector.Project(back.ray_in_cam);
      ASSERT_EQ(again.status, Status::kOk);
      ASSERT_LT((again.px - there.px).norm(), 2e-9);
      ++solved;
    }
  }
  for (double v = -500; v < 1500; v += 50) {
    for (double u = -500; u < 1800; u += 50) {
      const Unprojection back = projector.Unproject({u, v});
      if (back.status == Status::kOk) {
        ASSERT_LT((testing::ProjectExactly(camera, back.ray_in_cam) - Vector2mp(u, v)).norm(), 1e-9L);
      } else {
        ++refused;
      }
    }
  }
  EXPECT_GT(folded, 100);
  EXPECT_GT(solved, 1000);
  EXPECT_GT(refused, 100);
}

TEST(Projector, FisheyeSeesBesideAndBehindItself) {
  const Camera camera = MakeLens(LensModel::kKannalaBrandt4, {0.01, -0.002, 0, 0}, 1280, 960, 300);
  const Projector projector(camera);
  for (const double theta : {0.0, 1e-300, 1e-9, 0.5, kPi / 2 - 1e-9, kPi / 2, kPi / 2 + 1e-9, 2.0, 2.4}) {
    const Eigen::Vector3d ray = Direction(camera.model, theta, 1.1);
    const Projection projection = projector.Project(3 * ray);
    ASSERT_EQ(projection.status, Status::kOk) << theta;
    const long double radius = Radial<long double>(camera, theta);
    ASSERT_NEAR(projection.px[0], static_cast<double>(camera.cx() + camera.fx() * radius * std::cos(1.1L)), 1e-9) << theta;
    const Unprojection back = projector.Unproject(projection.px);
    ASSERT_EQ(back.status, Status::kOk) << theta;
    // A pixel near the centre cannot hold an angle below its own rounding.
    ASSERT_LT((back.ray_in_cam - ray).norm(), 2e-14) << theta;
  }
  EXPECT_EQ(projector.Project({0, 0, -1}).status, Status::kBehindCamera);
  EXPECT_EQ(projector.Project({0, 0, 0}).status, Status::kBehindCamera);
}

TEST(Projector, PerspectiveLensesRefusePointsBehind) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    if (IsWide(camera.model)) continue;
    const Projector projector(camera);
    for (const double z : {0.0, -0.0, -1e-300, -1.0}) EXPECT_EQ(projector.Project({0.1, 0, z}).status, Status::kBehindCamera);
    EXPECT_EQ(projector.ProjectWithJacobians({0, 0, -1}).status, Status::kBehindCamera);
    // So flat that the pixel would overflow.
    EXPECT_EQ(projector.Project({1, 1, std::numeric_limits<double>::denorm_min()}).status, Status::kOutsideValidRadius)
        << camera.name;
  }
}

TEST(Projector, NonFiniteInputIsSaidSo) {
  for (const Camera& camera : testing::OrdinaryLenses()) {
    const Projector projector(camera);
    for (const double bad : {kNaN, kInfinity, -kInfinity}) {
      for (int i = 0; i < 3; ++i) {
        Eigen::Vector3d x(0.1, 0.2, 1);
        x[i] = bad;
        EXPECT_EQ(projector.Project(x).status, Status::kNonFiniteInput);
        EXPECT_EQ(projector.ProjectWithJacobians(x).status, Status::kNonFiniteInput);
      }
      EXPECT_EQ(projector.Unproject({bad, 1}).status, Status::kNonFiniteInput);
      EXPECT_EQ(projector.Unproject({1, bad}).status, Status::kNonFiniteInput);
    }
  }
}

TEST(Projector, HugePixelsGiveAStatusOrAnExactRay) {
  std::vector<Camera> lenses = testing::OrdinaryLenses();
  for (const Camera& camera : testing::ExtremeLenses()) lenses.push_back(camera);
  for (const Camera& camera : lenses) {
    const Projector projector(camera);
    for (const double size : {1e5, 1e8, 1e15, 1e30, 1e200, 1e308}) {
      for (const Eigen::Vector2d& px : {Eigen::Vector2d(size, 3), Eigen::Vector2d(-size, size), Eigen::Vector2d(0, -size)}) {
        const Unprojection result = projector.Unproject(px);
        EXPECT_TRUE(result.ray_in_cam.allFinite());
        if (result.status != Status::kOk || size > 1e15) continue;
        const Vector2mp back = ProjectExactly(camera, result.ray_in_cam);
        // Rays of unit length near 90 degrees, or near the pole of a wide lens, carry size^2 roundings of their own in the
        // pixel.
        const double radius = size / camera.fx(), stretch = IsWide(camera.model) ? 3 * (1 + radius * radius) : 1 + radius;
        EXPECT_LT((back - px.cast<Mp>()).norm(), 1e-9 + 1e-15 * stretch * (IsWide(camera.model) ? camera.fx() : size))
            << camera.name << " " << size;
      }
    }
  }
}

TEST(Projector, OddImagesAndPrincipalPoints) {
  Camera camera = MakeLens(LensModel::kBrown5, {-0.1, 0.02, 1e-3, -1e-3, 0}, 1, 1, 100);
  EXPECT_EQ(Unproject(camera, {0, 0}).status, Status::kOk);
  camera = MakeLens(LensModel::kBrown5, {-0.1, 0.02, 1e-3, -1e-3, 0}, 100000, 100000, 90000);
  for (const double u : {0.0, 99999.0}) {
    const Unprojection result = Unproject(camera, {u, 0});
    ASSERT_EQ(result.status, Status::kOk);
    EXPECT_LT((ProjectExactly(camera, result.ray_in_cam) - Vector2mp(u, 0)).norm(), 1e-9L);
  }
  camera = MakeLens(LensModel::kBrown4, {-0.05, 0.01, 1e-3, -1e-3}, 640, 480, 800);
  camera.params[2] = -2000;
  EXPECT_EQ(Unproject(camera, {10, 10}).status, ValidRadius(camera) > 2.6 ? Status::kOk : Status::kOutsideValidRadius);
}

}  // namespace
}  // namespace mvstudio::geometry
