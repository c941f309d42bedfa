#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/random.h"
#include "core/units.h"
#include "tests/geometry/lens_samples.h"

namespace mvstudio::geometry {
namespace {

using testing::Direction;
using testing::MakeLens;
using testing::ProjectLong;
using testing::Vector2ld;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Root of f in [low, high] by bisection in long double.
template <class Function>
long double Root(const Function& f, long double low, long double high) {
  const bool sign = f(low) > 0;
  for (int i = 0; i < 200; ++i) {
    const long double mid = (low + high) / 2;
    ((f(mid) > 0) == sign ? low : high) = mid;
  }
  return low;
}

/// The radial function in long double, from the shared formula.
long double RadialLong(const Camera& camera, long double radius) {
  const testing::VectorXld params = camera.params.cast<long double>();
  if (camera.model == LensModel::kKannalaBrandt4) return KannalaBrandtRadius(params.data() + 4, radius);
  testing::VectorXld k = params.tail(params.size() - 4);
  if (k.size() >= 4) k[2] = k[3] = 0;
  long double a = 0, b = 0;
  DistortNormalized(camera.model, k.data(), radius, 0.0L, &a, &b);
  return a;
}

TEST(ValidRadius, IsTheFoldOfThePolynomial) {
  const Camera camera = MakeLens(LensModel::kBrown5, {-0.35, 0.15, 0, 0, -0.03});
  const auto slope = [](long double s) {
    return 1 + s * (3 * (long double)-0.35 + s * (5 * (long double)0.15 + s * 7 * (long double)-0.03));
  };
  const long double oracle = std::sqrt(Root(slope, 0, 3));
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
      const long double value = RadialLong(camera, end * j / 400.0L);
      ASSERT_GT(value, last) << "lens " << i << " folds before " << fold;
      last = value;
    }
    if (!(fold < 50) || fold == kPi) continue;
    ++folding;
    const long double before = RadialLong(camera, fold * (1 - 1e-7L)), at = RadialLong(camera, fold),
                      after = RadialLong(camera, fold * (1 + 1e-6L));
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

TEST(Projector, InvertsExtremeLensesOrSaysWhyNot) {
  for (const Camera& camera : testing::ExtremeLenses()) {
    const Projector projector(camera);
    const bool radial_only =
        camera.params.size() < 8 || camera.model == LensModel::kKannalaBrandt4 || camera.params.segment<2>(6).isZero(0);
    const double fold = projector.valid_radius();
    const long double reach = std::isinf(fold) ? kInfinity : RadialLong(camera, fold);
    int solved = 0;
    for (double v = -700; v < 1700; v += 47) {
      for (double u = -900; u < 2200; u += 53) {
        const Unprojection result = projector.Unproject({u, v});
        const long double radius = std::hypot((u - camera.cx()) / camera.fx(), (v - camera.cy()) / camera.fy());
        if (radial_only) {
          ASSERT_EQ(result.status, radius <= reach ? Status::kOk : Status::kOutsideValidRadius)
              << camera.name << " " << u << " " << v;
        } else if (radius < 0.9L * reach) {
          ASSERT_EQ(result.status, Status::kOk) << camera.name << " " << u << " " << v;
        }
        if (result.status != Status::kOk) continue;
        ++solved;
        ASSERT_LT((ProjectLong(camera, result.ray_in_cam) - Vector2ld(u, v)).norm(), 1e-9L)
            << camera.name << " " << u << " " << v;
      }
    }
    EXPECT_GT(solved, 80) << camera.name;
  }
}

/// Newton's method in long double from the answer must not move it by more than the answer's own rounding.
TEST(Projector, AgreesWithNewtonInLongDouble) {
  for (const Camera& camera : testing::ExtremeLenses()) {
    const Projector projector(camera);
    const double fold = std::min(projector.valid_radius(), 1.2);
    for (int i = 1; i <= 60; ++i) {
      const double radius = fold * i / 64;
      const Eigen::Vector2d px = projector.Project(Direction(camera.model, radius, 0)).px;
      if (camera.params.size() > 7 && camera.model != LensModel::kKannalaBrandt4 && !camera.params.segment<2>(6).isZero(0))
        continue;
      const long double target = (static_cast<long double>(px[0]) - camera.cx()) / camera.fx();
      const long double oracle = Root([&](long double r) { return target - RadialLong(camera, r); }, 0,
                                      projector.valid_radius() < 10 ? projector.valid_radius() : 10.0L);
      const Eigen::Vector3d ray = projector.Unproject(px).ray_in_cam;
      const double found =
          camera.model == LensModel::kKannalaBrandt4 ? std::atan2(ray.head<2>().norm(), ray[2]) : ray[0] / ray[2];
      const long double slope = (RadialLong(camera, oracle + 1e-7L) - RadialLong(camera, oracle - 1e-7L)) / 2e-7L;
      ASSERT_NEAR(found, static_cast<double>(oracle), 1e-14 / std::min(1.0, static_cast<double>(slope)))
          << camera.name << " " << radius;
    }
  }
}

TEST(Projector, FisheyeSeesBesideAndBehindItself) {
  const Camera camera = MakeLens(LensModel::kKannalaBrandt4, {0.01, -0.002, 0, 0}, 1280, 960, 300);
  const Projector projector(camera);
  for (const double theta : {0.0, 1e-300, 1e-9, 0.5, kPi / 2 - 1e-9, kPi / 2, kPi / 2 + 1e-9, 2.0, 2.4}) {
    const Eigen::Vector3d ray = Direction(camera.model, theta, 1.1);
    const Projection projection = projector.Project(3 * ray);
    ASSERT_EQ(projection.status, Status::kOk) << theta;
    const long double radius = RadialLong(camera, theta);
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
    if (camera.model == LensModel::kKannalaBrandt4) continue;
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
        const Vector2ld back = ProjectLong(camera, result.ray_in_cam);
        // Rays of unit length near 90 degrees carry size^2 roundings of their own in the pixel.
        EXPECT_LT((back - px.cast<long double>()).norm(), 1e-9 + 1e-15 * size * (1 + size / camera.fx()))
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
    EXPECT_LT((ProjectLong(camera, result.ray_in_cam) - Vector2ld(u, 0)).norm(), 1e-9L);
  }
  camera = MakeLens(LensModel::kBrown4, {-0.05, 0.01, 1e-3, -1e-3}, 640, 480, 800);
  camera.params[2] = -2000;
  EXPECT_EQ(Unproject(camera, {10, 10}).status, ValidRadius(camera) > 2.6 ? Status::kOk : Status::kOutsideValidRadius);
}

}  // namespace
}  // namespace mvstudio::geometry
