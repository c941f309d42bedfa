#include <gtest/gtest.h>

#include <limits>

#include "tests/triangulate/oracle.h"
#include "tests/triangulate/support.h"
#include "triangulate/batch/batch.h"

/// Numbers at the ends of what is possible: an honest answer or a status, never a crash or a finite lie.
namespace mvstudio::triangulate {
namespace {

bool IsHonest(const Point& point) {
  if (point.status != Status::kOk) return true;
  return point.x_in_world.allFinite() && point.covariance.allFinite() && std::isfinite(point.chi_squared) &&
         (point.covariance.diagonal().array() > 0).all() && point.used.size() >= 2;
}

TEST(Extremes, AnyNumbersGiveAnHonestAnswer) {
  const double values[] = {0,
                           -0.0,
                           1e-308,
                           5e-324,
                           1e-30,
                           1e-9,
                           1,
                           639.5,
                           1e4,
                           -1e4,
                           1e15,
                           -1e15,
                           1e30,
                           1e154,
                           1e200,
                           1e308,
                           -1e308,
                           std::numeric_limits<double>::infinity(),
                           std::numeric_limits<double>::quiet_NaN()};
  Rng rng(3);
  const auto any = [&] { return values[rng.Index(std::size(values))]; };
  for (const int num_cameras : {2, 3, 5, 9}) {
    const geometry::Rig rig = MakeRing(std::max(num_cameras, 3));
    const PreparedRig prepared = Prepare(rig);
    PointBatch batch = MakeBatch(static_cast<int>(rig.cameras.size()), 400);
    for (int64_t i = 0; i < batch.num_points; ++i) {
      std::vector<Observation> observations = Observe(rig, RandomPoint(&rng), 1, &rng);
      observations.resize(num_cameras);
      for (int k = 0; k < 1 + static_cast<int>(rng.Index(4)); ++k) {
        Observation& seen = observations[rng.Index(num_cameras)];
        switch (rng.Index(3)) {
          case 0:
            seen.px.x() = any();
            break;
          case 1:
            seen.px.y() = any();
            break;
          default:
            seen.sigma_px = any();
        }
      }
      for (const PointMethod method : kAllPointMethods) {
        PointOptions options;
        options.method = method;
        EXPECT_TRUE(IsHonest(TriangulatePoint(prepared, observations, options))) << ToString(method) << ", point " << i;
      }
      for (const Observation& seen : observations) {
        batch.x_px[seen.camera_idx * 400 + i] = seen.px.x();
        batch.y_px[seen.camera_idx * 400 + i] = seen.px.y();
        batch.sigma_px[seen.camera_idx * 400 + i] = seen.sigma_px;
      }
    }
    for (const bool single : {false, true}) {
      BatchOptions options;
      options.single_precision = single;
      const BatchResult result = TriangulateBatch(prepared, batch, options);
      for (int64_t i = 0; i < batch.num_points; ++i) {
        if (result.StatusOf(i) != Status::kOk) continue;
        EXPECT_TRUE(std::isfinite(result.x[i]) && std::isfinite(result.covariance[i]) && result.covariance[i] > 0) << i;
      }
    }
  }
}

// A rig of any size gives the same answer in its own units.
TEST(Extremes, RigsFromMicrometresToLightYears) {
  const geometry::Rig metres = MakeRing(5);
  Rng rng(5);
  const Eigen::Vector3d place = RandomPoint(&rng);
  const Point in_metres = TriangulatePoint(Prepare(metres), Observe(metres, place, 0, nullptr, 0.5));
  for (const double size : {1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e12, 1e16}) {
    geometry::Rig rig = metres;
    for (geometry::RigCamera& camera : rig.cameras) camera.cam_from_world.translation *= size;
    const Eigen::Vector3d truth = size * place;
    const Point point = TriangulatePoint(Prepare(rig), Observe(rig, truth, 0, nullptr, 0.5));
    ASSERT_EQ(point.status, Status::kOk) << size;
    EXPECT_LT((point.x_in_world - truth).norm(), 1e-12 * size) << size;
    EXPECT_NEAR(point.covariance(0, 0) / (size * size) / in_metres.covariance(0, 0), 1, 1e-9) << size;
  }
}

// Views whose noise differs by many orders: the optimum is still that of 60 digits.
TEST(Extremes, NoiseOfVeryDifferentSize) {
  const geometry::Rig rig = MakeRing(6);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(7);
  for (const double ratio : {1e2, 1e4, 1e6}) {
    const Eigen::Vector3d truth = RandomPoint(&rng);
    std::vector<Observation> observations = Observe(rig, truth);
    for (Observation& seen : observations) {
      seen.sigma_px = seen.camera_idx % 2 ? 1.0 : 1.0 / ratio;
      seen.px += seen.sigma_px * Eigen::Vector2d(rng.Normal(), rng.Normal());
    }
    const Point point = TriangulatePoint(prepared, observations);
    ASSERT_EQ(point.status, Status::kOk) << ratio;
    const oracle::Optimum best = oracle::MostLikely(rig, observations, truth);
    const Eigen::Vector3d apart = point.x_in_world - oracle::ToDouble(best.x_in_world);
    EXPECT_LT(std::sqrt(apart.dot(point.covariance.inverse() * apart)), 1e-5) << ratio;
  }
}

TEST(Extremes, LongLenses) {  // 0.1 to 3.4 degrees of view, as cameras that film flies
  Rng rng(9);
  for (const double focal_px : {16041.0, 1e5, 1e6}) {
    geometry::Rig rig;
    for (const double deg : {0.0, 40.0, 95.0}) {
      rig.cameras.push_back(LookAt("c" + std::to_string(deg),
                                   0.5 * Eigen::Vector3d(std::cos(DegToRad(deg)), std::sin(DegToRad(deg)), 0.1), {0, 0, 0},
                                   focal_px));
    }
    const Eigen::Vector3d truth = RandomPoint(&rng, 5 / focal_px);
    const Point point = TriangulatePoint(Prepare(rig), Observe(rig, truth));
    ASSERT_EQ(point.status, Status::kOk);
    EXPECT_LT((point.x_in_world - truth).norm(), 1e-15 + 1e-12 / focal_px);
  }
}

}  // namespace
}  // namespace mvstudio::triangulate
