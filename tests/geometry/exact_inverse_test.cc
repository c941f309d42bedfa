#include <cmath>
#include <limits>

#include "core/random.h"
#include "core/units.h"
#include "tests/geometry/exact_lens.h"
#include "tests/support/test.h"

/// Every lens's inverse against Newton's method in numbers of 60 digits.
namespace mvstudio::geometry {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

std::vector<Camera> WithFocal(std::vector<Camera> lenses, double focal) {
  for (Camera& camera : lenses) {
    camera.params.head<2>() << focal, 1.002 * focal;
    camera.width_px = 4000, camera.height_px = 3000;
    camera.params.segment<2>(2) << 1999.5 + 31.7, 1499.5 - 18.1;
  }
  return lenses;
}

/// The promise of Projector::Unproject about its residual, and no more change of the ray than that residual and the rounding of
/// the ray's coordinates explain.
void ExpectExact(const Camera& camera, const Eigen::Vector2d& px, const Eigen::Vector3d& near, const std::string& where) {
  const Unprojection found = Projector(camera).Unproject(px);
  ASSERT_EQ(found.status, Status::kOk) << camera.name << " " << where << " px " << px.transpose();
  const ExactRay exact = testing::UnprojectExactly(camera, px, near);
  ASSERT_TRUE(exact.found) << camera.name << " " << where;
  const Eigen::Matrix2d by_angle = exact.d_px_d_tangent.cast<double>();
  const Eigen::Vector2d stretch = by_angle.jacobiSvd().singularValues();
  const double size = px.lpNorm<Eigen::Infinity>() + std::max(std::abs(camera.cx()), std::abs(camera.cy()));
  const double limit_px = std::max({1e-9, 8 * kEpsilon * size, 4 * kEpsilon * stretch[0]});
  const double residual = static_cast<double>((testing::ProjectExactly(camera, found.ray_in_cam) - px.cast<Mp>()).norm());
  ASSERT_LE(residual, limit_px) << camera.name << " " << where;
  const double apart = static_cast<double>((exact.ray - found.ray_in_cam.cast<Mp>()).norm());
  ASSERT_LE(apart, 1.01 * residual / stretch[1] + 4 * kEpsilon) << camera.name << " " << where;
}

void ExpectExactUpToReach(const std::vector<Camera>& lenses, int count) {
  for (const Camera& camera : lenses) {
    const double reach = testing::Reach(camera);
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d x = Direction(camera.model, reach * (i + 0.5) / count, 2.39996 * i).normalized();
      const Projection there = Projector(camera).Project(x);
      ASSERT_EQ(there.status, Status::kOk) << camera.name;
      ASSERT_NO_FATAL_FAILURE(ExpectExact(camera, there.px, x, "radius " + std::to_string(reach * (i + 0.5) / count)));
    }
  }
}

TEST(ExactInverse, AllLensesUpToTheirReach) { ExpectExactUpToReach(AllLenses(), 40); }

TEST(ExactInverse, FocalLengthsOfAHundredThousandPixels) { ExpectExactUpToReach(WithFocal(AllLenses(), 1e5), 20); }

TEST(ExactInverse, FocalLengthsOfOnePixel) { ExpectExactUpToReach(WithFocal(AllLenses(), 1), 10); }

/// Random lenses of every model.
TEST(ExactInverse, RandomLenses) {
  Rng rng(11);
  for (const Camera& ordinary : testing::OrdinaryLenses()) {
    if (ordinary.model == LensModel::kSplined) continue;
    for (int i = 0; i < 12; ++i) {
      Camera camera = ordinary;
      for (Eigen::Index k = 4; k < camera.params.size(); ++k) camera.params[k] *= rng.Uniform(-1.5, 1.5);
      if (!WhyInvalidLens(camera).empty()) continue;
      const double radius = testing::Reach(camera) * rng.Uniform(0, 1);
      const Eigen::Vector3d x = Direction(camera.model, radius, rng.Uniform(0, 2 * kPi)).normalized();
      const Projection there = Projector(camera).Project(x);
      ASSERT_EQ(there.status, Status::kOk) << camera.name;
      ASSERT_NO_FATAL_FAILURE(ExpectExact(camera, there.px, x, "random " + std::to_string(i)));
    }
  }
}

/// Radial lenses that end at a fold or a pole, with its radius found in 60 digits.
struct Fold {
  Camera camera;
  Mp radius;
  bool pole = false;
};

/// The sign of the slope changes at a fold, that of the value (or of its being defined) at a pole.
bool FindFold(const Camera& camera, Fold* fold) {
  const double radius = ValidRadius(camera);
  if (std::isinf(radius) || radius > kPi - 1e-9 || !testing::IsRadial(camera) || camera.model == LensModel::kSplined)
    return false;
  fold->camera = camera;
  const Mp before = Mp(radius) * (1 - Mp("1e-9")), after = Mp(radius) * (1 + Mp("1e-9"));
  fold->pole = Radial<Mp>(camera, before) > 1e5;
  const auto rising = [&](const Mp& at) {
    return Mp(fold->pole ? (Radial<Mp>(camera, at) > 0 ? 1 : -1) : testing::RadialSlope(camera, at));
  };
  EXPECT_GT(rising(before), 0) << camera.name;
  EXPECT_LE(rising(after), 0) << camera.name;
  fold->radius = testing::Root(rising, before, after);
  return true;
}

std::vector<Fold> AllFolds() {
  std::vector<Camera> lenses = AllLenses();
  // Decentred and prism lenses with those terms at zero have the same folds, by another path of the code.
  for (Camera camera : AllLenses()) {
    if (testing::IsRadial(camera) || camera.model == LensModel::kSplined) continue;
    const std::vector<std::string> names = ParamNames(camera);
    for (size_t i = 4; i < names.size(); ++i) {
      if (names[i][0] == 'p' || names[i][0] == 's') camera.params[static_cast<Eigen::Index>(i)] = 0;
    }
    lenses.push_back(camera);
  }
  lenses.push_back(MakeLens(LensModel::kBrown5, {-0.35, 0.15, 0, 0, -0.03}));
  lenses.push_back(MakeLens(LensModel::kRational8, {0, 0, 0, 0, 0, -1, 0, 0}));
  lenses.push_back(MakeLens(LensModel::kRational8, {0.1, 0.01, 0, 0, 0, 1.2, 0.2, 0.01}));
  lenses.push_back(MakeLens(LensModel::kKannalaBrandt4, {-0.1, 0, 0, 0}, 1280, 960, 300));
  std::vector<Fold> folds;
  for (const Camera& camera : lenses) {
    Fold fold;
    if (FindFold(camera, &fold)) folds.push_back(fold);
  }
  return folds;
}

TEST(ExactFold, RadiusIsRightToItsLastDigits) {
  const std::vector<Fold> folds = AllFolds();
  EXPECT_GE(folds.size(), 25u);
  for (const Fold& fold : folds) {
    const double error = static_cast<double>(Mp(ValidRadius(fold.camera)) / fold.radius - 1);
    EXPECT_LT(std::abs(error), 8 * kEpsilon) << fold.camera.name << " " << fold.camera.params.transpose();
  }
}

/// Closer and closer to the fold, where the inverse grows ill-conditioned as the inverse of the distance.
TEST(ExactFold, InverseUpToTheFold) {
  for (const Fold& fold : AllFolds()) {
    const Camera& camera = fold.camera;
    for (const double distance : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6}) {
      const Eigen::Vector3d x = Direction(camera.model, static_cast<double>(fold.radius * (1 - distance)), 0.8).normalized();
      const Projection there = Projector(camera).Project(x);
      ASSERT_EQ(there.status, Status::kOk) << camera.name << " " << distance;
      ASSERT_NO_FATAL_FAILURE(ExpectExact(camera, there.px, x, "before the fold " + std::to_string(distance)));
    }
  }
}

/// A pixel a little beyond the image of the fold has no ray, one a little nearer has; the same for points.
TEST(ExactFold, StatusesOnBothSides) {
  for (const Fold& fold : AllFolds()) {
    const Camera& camera = fold.camera;
    const Projector projector(camera);
    for (const double step : {1e-12, 1e-9, 1e-6, 1e-3}) {
      const auto at = [&](double sign) {
        return projector.Project(Direction(camera.model, static_cast<double>(fold.radius * (1 + sign * step)), 2.2)).status;
      };
      EXPECT_EQ(at(-1), Status::kOk) << camera.name << " " << step;
      EXPECT_EQ(at(1), Status::kOutsideValidRadius) << camera.name << " " << step;
      if (fold.pole) continue;
      const Mp reach = Radial<Mp>(camera, fold.radius * (1 - Mp("1e-30")));
      const auto pixel = [&](double sign) {
        const double radius = static_cast<double>(reach * (1 + sign * step));
        return projector
            .Unproject({camera.cx() + camera.fx() * radius * std::cos(2.2), camera.cy() + camera.fy() * radius * std::sin(2.2)})
            .status;
      };
      EXPECT_EQ(pixel(-1), Status::kOk) << camera.name << " " << step << " reach " << reach;
      EXPECT_EQ(pixel(1), Status::kOutsideValidRadius) << camera.name << " " << step << " reach " << reach;
    }
  }
}

/// Lenses with a pole see every pixel: 1e6 focal lengths away, still.
TEST(ExactFold, PolesReachEveryPixel) {
  int poles = 0;
  for (const Fold& fold : AllFolds()) {
    if (!fold.pole) continue;
    ++poles;
    const Camera& camera = fold.camera;
    for (const double far : {10.0, 1e3, 1e6}) {
      const Unprojection found = Projector(camera).Unproject({camera.cx() + far * camera.fx(), camera.cy()});
      ASSERT_EQ(found.status, Status::kOk) << camera.name << " " << far;
      const Mp target(far);
      const Mp exact =
          testing::Root([&](const Mp& r) { return Mp(target - Radial<Mp>(camera, r)); }, 0, fold.radius * (1 - Mp("1e-50")));
      const Eigen::Vector3d& ray = found.ray_in_cam;
      const double radius = IsWide(camera.model) ? std::atan2(ray.head<2>().norm(), ray[2]) : ray[0] / ray[2];
      EXPECT_NEAR(radius, static_cast<double>(exact), 4 * kEpsilon * (1 + static_cast<double>(exact))) << camera.name << far;
    }
  }
  EXPECT_GE(poles, 4);
}

}  // namespace
}  // namespace mvstudio::geometry
