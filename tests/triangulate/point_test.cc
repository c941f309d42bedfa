#include "triangulate/point/point.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "core/error.h"
#include "core/statistics.h"
#include "tests/triangulate/support.h"

namespace mvstudio::triangulate {
namespace {

using ::testing::ElementsAre;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Point Triangulate(const geometry::Rig& rig, const std::vector<Observation>& observations, const PointOptions& options = {}) {
  return TriangulatePoint(Prepare(rig), observations, options);
}

TEST(TriangulatePoint, RecoversNoiseFreePoints) {
  Rng rng(1);
  for (const int num_cameras : {2, 3, 4, 8, 31}) {
    const geometry::Rig rig = MakeRing(num_cameras == 2 ? 5 : num_cameras);
    for (int trial = 0; trial < 50; ++trial) {
      const Eigen::Vector3d truth = RandomPoint(&rng);
      std::vector<Observation> observations = Observe(rig, truth);
      if (num_cameras == 2) observations.resize(2);
      const Point point = Triangulate(rig, observations);
      ASSERT_EQ(point.status, Status::kOk);
      EXPECT_LT((point.x_in_world - truth).norm(), 1e-12);
      EXPECT_LT(point.rms_px, 1e-9);
      EXPECT_EQ(point.used.size(), observations.size());
    }
  }
}

/// Exact files state or lead to sigmas below the rounding of a pixel: no step can be a millionth of those.
TEST(TriangulatePoint, SigmasBelowRoundingAreNoReasonNotToConverge) {
  const geometry::Rig rig = MakeRing(5);
  Rng rng(2);
  for (const double sigma_px : {1e-6, 1e-9, 1e-13}) {
    for (int trial = 0; trial < 200; ++trial) {
      const Eigen::Vector3d truth = RandomPoint(&rng);
      std::vector<Observation> observations = Observe(rig, truth);
      observations.resize(2);
      for (Observation& observation : observations) observation.sigma_px = sigma_px;
      const Point point = Triangulate(rig, observations);
      ASSERT_EQ(point.status, Status::kOk) << sigma_px;
      EXPECT_LT((point.x_in_world - truth).norm(), 1e-12);
    }
  }
}

TEST(TriangulatePoint, AllMethodsRecoverNoiseFreePoints) {
  const geometry::Rig rig = MakeRing(6);
  const Eigen::Vector3d truth(0.3, -0.2, 0.5);
  for (const PointMethod method :
       {PointMethod::kRobust, PointMethod::kAllViews, PointMethod::kLinear, PointMethod::kMidpoint}) {
    PointOptions options;
    options.method = method;
    const Point point = Triangulate(rig, Observe(rig, truth), options);
    ASSERT_EQ(point.status, Status::kOk);
    EXPECT_LT((point.x_in_world - truth).norm(), 1e-9);
  }
}

// Limits: ten times what inhomogeneous least squares in centred coordinates reaches on a ring of 8 cameras.
TEST(TriangulatePoint, SurvivesAFarWorldOrigin) {
  const std::pair<double, double> offset_and_limit_m[] = {{0, 5.2e-15}, {10, 6.9e-14}, {1e3, 7.6e-12}, {1e5, 5.9e-10}};
  for (const auto& [offset, limit] : offset_and_limit_m) {
    const Eigen::Vector3d middle = offset * Eigen::Vector3d(0.6, -0.64, 0.48);
    const geometry::Rig rig = MakeRing(8, 3, middle);
    Rng rng(3);
    std::vector<double> errors;
    for (int trial = 0; trial < 101; ++trial) {
      const Eigen::Vector3d truth = middle + RandomPoint(&rng);
      const Point point = Triangulate(rig, Observe(rig, truth));
      ASSERT_EQ(point.status, Status::kOk);
      errors.push_back((point.x_in_world - truth).norm());
    }
    EXPECT_LT(UpperMedian(errors), limit) << "offset " << offset << " m";
  }
}

TEST(TriangulatePoint, DoesNotDependOnTheOrderOfCamerasOrOnUnits) {
  Rng rng(5);
  const geometry::Rig rig = MakeRing(6);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<Observation> observations = Observe(rig, RandomPoint(&rng), 1.0, &rng);
    observations[trial % 6].px += Eigen::Vector2d(60, -40);
    const Point point = Triangulate(rig, observations);
    std::reverse(observations.begin(), observations.end());
    const Point reversed = Triangulate(rig, observations);
    ASSERT_EQ(point.status, reversed.status);
    EXPECT_LT((point.x_in_world - reversed.x_in_world).norm(), 1e-9);

    geometry::Rig in_km = rig;
    for (geometry::RigCamera& camera : in_km.cameras) camera.cam_from_world.translation *= 1e-3;
    std::reverse(observations.begin(), observations.end());
    const Point scaled = Triangulate(in_km, observations);
    ASSERT_EQ(point.status, scaled.status);
    EXPECT_EQ(point.used, scaled.used);
    EXPECT_LT((1e3 * scaled.x_in_world - point.x_in_world).norm(), 1e-9);
  }
}

// With sigma = 1 px at f = 1000 px the parallax is known to sqrt(2) mrad: five of these are 0.405 degrees.
TEST(TriangulatePoint, ParallaxSweep) {
  const double threshold = 5 * std::sqrt(2.0) / 1000;
  for (const double deg : {0.0,  1e-6, 1e-3,  0.01,  0.1,   0.3,    0.39,   0.42,  0.6,    1.0,  10.0,
                           60.0, 90.0, 150.0, 179.0, 179.4, 179.58, 179.61, 179.9, 179.99, 180.0}) {
    const geometry::Rig rig = TwoCameras(DegToRad(deg));
    const Point point = Triangulate(rig, Observe(rig, Eigen::Vector3d::Zero()));
    if (deg == 0) {
      EXPECT_EQ(point.status, Status::kDegenerate) << "both cameras are the same";
    } else if (std::sin(DegToRad(deg)) < threshold) {
      EXPECT_EQ(point.status, Status::kLowParallax) << deg << " deg";
    } else {
      ASSERT_EQ(point.status, Status::kOk) << deg << " deg";
      EXPECT_LT(point.x_in_world.norm(), 1e-9) << deg << " deg";
    }
  }
}

TEST(TriangulatePoint, SmallParallaxIsFineForGoodDetections) {
  const geometry::Rig rig = TwoCameras(DegToRad(0.01));
  const Point point = Triangulate(rig, Observe(rig, Eigen::Vector3d::Zero(), 0, nullptr, 1e-3));
  ASSERT_EQ(point.status, Status::kOk);
  EXPECT_LT(point.x_in_world.norm(), 1e-6);
}

TEST(TriangulatePoint, OneCentreIsDegenerate) {
  Rng rng(7);
  for (const double offset : {0.0, 1.0, 1e5}) {
    const Eigen::Vector3d center = offset * Eigen::Vector3d(0.3, 0.4, -0.5);
    geometry::Rig rig;
    for (const double y : {-0.2, 0.0, 0.3})
      rig.cameras.push_back(LookAt("c" + std::to_string(y), center, center + Eigen::Vector3d(1, y, y)));
    std::vector<Observation> observations = Observe(rig, center + Eigen::Vector3d(4, 0.1, 0.2));
    EXPECT_EQ(Triangulate(rig, observations).status, Status::kDegenerate) << offset;
    for (Observation& seen : observations) seen.px += 20 * Eigen::Vector2d(rng.Normal(), rng.Normal());
    EXPECT_EQ(Triangulate(rig, observations).status, Status::kDegenerate) << offset;
  }
}

TEST(TriangulatePoint, PointOnTheBaseline) {
  geometry::Rig in_line;  // one camera behind the other, the point ahead of both
  in_line.cameras = {LookAt("near", {0, 0, 0}, {1, 0, 0}), LookAt("far", {-2, 0, 0}, {1, 0, 0})};
  EXPECT_EQ(Triangulate(in_line, Observe(in_line, {3, 0, 0})).status, Status::kLowParallax);
  geometry::Rig facing;
  facing.cameras = {LookAt("a", {-2, 0, 0}, {1, 0, 0}), LookAt("b", {2, 0, 0}, {-1, 0, 0})};
  EXPECT_EQ(Triangulate(facing, Observe(facing, {0.5, 0, 0})).status, Status::kLowParallax);
  facing.cameras.push_back(LookAt("c", {0, -2, 0}, {0, 0, 0}));
  const Point point = Triangulate(facing, Observe(facing, {0.5, 0, 0}));
  ASSERT_EQ(point.status, Status::kOk);
  EXPECT_LT((point.x_in_world - Eigen::Vector3d(0.5, 0, 0)).norm(), 1e-12);
}

TEST(TriangulatePoint, PointAtACameraCentre) {
  geometry::Rig rig;
  rig.cameras = {LookAt("a", {-2, 0, 0}, {0, 0, 0}), LookAt("b", {0, 0, 0}, {0, 1, 0})};
  std::vector<Observation> observations = Observe(rig, {0, 0, 0});
  ASSERT_EQ(observations.size(), 1u);
  Rng rng(11);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Vector2d anywhere(rng.Uniform(0, 1279), rng.Uniform(0, 959));
    EXPECT_EQ(Triangulate(rig, {observations[0], {1, anywhere, 1, 1}}).status, Status::kDegenerate);
  }
}

TEST(TriangulatePoint, BehindAllCameras) {
  geometry::Rig rig;
  for (const double y : {-1.0, 0.0, 1.0}) rig.cameras.push_back(LookAt("c" + std::to_string(y), {0, y, 0}, {10, y, 0}));
  std::vector<Observation> observations;
  for (int c = 0; c < 3; ++c) {  // the pixels of a point at (-3, 0, 0.5), projected through the centre
    const Eigen::Vector3d x = rig.cameras[c].cam_from_world * Eigen::Vector3d(-3, 0, 0.5);
    observations.push_back({c, {1000 * x.x() / x.z() + 639.5, 1000 * x.y() / x.z() + 479.5}, 1, 1});
  }
  EXPECT_EQ(Triangulate(rig, observations).status, Status::kBehindCamera);
  EXPECT_EQ(Triangulate(rig, {observations[0], observations[2]}).status, Status::kBehindCamera);
}

TEST(TriangulatePoint, CameraThatFacesAwayIsLeftOut) {
  geometry::Rig rig = MakeRing(5);
  rig.cameras.push_back(LookAt("away", {0, 0, 3}, {0, 0, 9}));
  const Eigen::Vector3d truth(0.2, 0.1, -0.1);
  std::vector<Observation> observations = Observe(rig, truth);
  ASSERT_EQ(observations.size(), 5u);
  const Eigen::Vector3d x = rig.cameras[5].cam_from_world * truth;
  observations.push_back({5, {1000 * x.x() / x.z() + 639.5, 1000 * x.y() / x.z() + 479.5}, 1, 1});
  const Point point = Triangulate(rig, observations);
  ASSERT_EQ(point.status, Status::kOk);
  EXPECT_THAT(point.used, ElementsAre(0, 1, 2, 3, 4));
  EXPECT_LT((point.x_in_world - truth).norm(), 1e-12);
}

TEST(TriangulatePoint, InfinityAndFarPoints) {
  geometry::Rig rig;
  for (const double y : {-2.0, 0.0, 2.0}) rig.cameras.push_back(LookAt("c" + std::to_string(y), {0, y, 0}, {10, y, 0}));
  const Eigen::Vector2d same(700, 500);
  EXPECT_EQ(Triangulate(rig, {{0, same, 1, 1}, {1, same, 1, 1}, {2, same, 1, 1}}).status, Status::kLowParallax);
  PointOptions options;
  EXPECT_EQ(Triangulate(rig, Observe(rig, {100, 1, 1}), options).status, Status::kOk);
  options.max_distance_m = 50;
  EXPECT_EQ(Triangulate(rig, Observe(rig, {100, 1, 1}), options).status, Status::kFarPoint);
  EXPECT_EQ(Triangulate(rig, Observe(rig, {20, 1, 1}), options).status, Status::kOk);
  EXPECT_EQ(Triangulate(rig, Observe(rig, {1e7, 1, 1}), options).status, Status::kLowParallax);
}

TEST(TriangulatePoint, TooFewViewsAndNonFiniteInput) {
  const geometry::Rig rig = MakeRing(4);
  const Eigen::Vector3d truth(0.1, 0.2, 0.3);
  std::vector<Observation> observations = Observe(rig, truth);
  EXPECT_EQ(Triangulate(rig, {}).status, Status::kTooFewViews);
  EXPECT_EQ(Triangulate(rig, {observations[0]}).status, Status::kTooFewViews);
  observations[1].px.x() = kNan;
  Point point = Triangulate(rig, observations);
  ASSERT_EQ(point.status, Status::kOk);
  EXPECT_THAT(point.used, ElementsAre(0, 2, 3));
  EXPECT_LT((point.x_in_world - truth).norm(), 1e-12);
  observations[0].sigma_px = kNan;
  observations[2].px.y() = std::numeric_limits<double>::infinity();
  EXPECT_EQ(Triangulate(rig, observations).status, Status::kNonFiniteInput);
  EXPECT_EQ(Triangulate(rig, {observations[3]}).status, Status::kTooFewViews);
}

TEST(TriangulatePoint, PixelBeyondTheLensIsNamed) {
  geometry::Rig rig = MakeRing(2);
  for (auto& camera : rig.cameras) camera.camera.params.tail<5>() << -0.5, 0, 0, 0, 0;  // folds at r = 0.816, distorted 0.544
  const std::vector<Observation> beyond = {{0, {639.5 + 800, 479.5}, 1, 1}, {1, {639.5, 479.5}, 1, 1}};
  EXPECT_EQ(Triangulate(rig, beyond).status, Status::kOutsideValidRadius);
}

TEST(TriangulatePoint, RepeatedCameraIsTheCallersMistake) {
  const geometry::Rig rig = MakeRing(3);
  EXPECT_THROW(Triangulate(rig, {{0, {1, 1}, 1, 1}, {0, {2, 2}, 1, 1}}), ContractViolation);
  EXPECT_THROW(Triangulate(rig, {{0, {1, 1}, 1, 1}, {3, {2, 2}, 1, 1}}), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::triangulate
