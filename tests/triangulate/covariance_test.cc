#include <gtest/gtest.h>

#include <Eigen/LU>

#include "tests/triangulate/support.h"
#include "triangulate/batch/batch.h"
#include "triangulate/point/noise.h"
#include "triangulate/point/point.h"

namespace mvstudio::triangulate {
namespace {

constexpr int kTrials = 1500;
// Quantiles of chi-squared with 3 degrees of freedom.
constexpr double kChiSquared68 = 3.5058820;
constexpr double kChiSquared95 = 7.8147279;

struct Coverage {
  int num = 0, inside68 = 0, inside95 = 0;
  double chi_squared = 0, degrees_of_freedom = 0;
};

void Count(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance, double chi_squared, int num_views,
           Coverage* coverage) {
  const double distance = error.dot(covariance.inverse() * error);
  ++coverage->num;
  coverage->inside68 += distance < kChiSquared68;
  coverage->inside95 += distance < kChiSquared95;
  coverage->chi_squared += chi_squared;
  coverage->degrees_of_freedom += 2.0 * num_views - 3;
}

Coverage Measure(const geometry::Rig& rig, double noise_px, uint64_t seed) {
  const PreparedRig prepared = Prepare(rig);
  Rng rng(seed);
  Coverage coverage;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::Vector3d truth = RandomPoint(&rng, 0.1);
    const Point point = TriangulatePoint(prepared, Observe(rig, truth, noise_px, &rng, noise_px));
    if (point.status != Status::kOk) continue;
    Count(point.x_in_world - truth, point.covariance, point.chi_squared, static_cast<int>(point.used.size()), &coverage);
  }
  return coverage;
}

/// The same by TriangulateBatch with two Gauss-Newton steps.
Coverage MeasureBatch(const geometry::Rig& rig, double noise_px, uint64_t seed) {
  Rng rng(seed);
  PointBatch batch = MakeBatch(static_cast<int>(rig.cameras.size()), kTrials);
  std::vector<Eigen::Vector3d> truth;
  for (int i = 0; i < kTrials; ++i) {
    truth.push_back(RandomPoint(&rng, 0.1));
    for (const Observation& seen : Observe(rig, truth.back(), noise_px, &rng, noise_px)) {
      const size_t at = static_cast<size_t>(seen.camera_idx * kTrials + i);
      batch.x_px[at] = seen.px.x(), batch.y_px[at] = seen.px.y(), batch.sigma_px[at] = noise_px;
    }
  }
  BatchOptions options;
  options.gauss_newton_steps = 2;
  const BatchResult result = TriangulateBatch(Prepare(rig), batch, options);
  Coverage coverage;
  for (int i = 0; i < kTrials; ++i) {
    if (result.StatusOf(i) != Status::kOk) continue;
    Eigen::Matrix3d covariance;
    const auto c = [&](int k) { return result.covariance[k * kTrials + i]; };
    covariance << c(0), c(1), c(2), c(1), c(3), c(4), c(2), c(4), c(5);
    Count(Eigen::Vector3d(result.x[i], result.y[i], result.z[i]) - truth[i], covariance, result.chi_squared[i],
          result.num_views[i], &coverage);
  }
  return coverage;
}

/// Three standard deviations of a binomial fraction.
double Band(double p, int n) { return 3 * std::sqrt(p * (1 - p) / n); }

void ExpectHonest(const Coverage& coverage, const std::string& what) {
  EXPECT_GE(coverage.num, kTrials - 15) << what;
  EXPECT_NEAR(static_cast<double>(coverage.inside68) / coverage.num, 0.68, Band(0.68, coverage.num)) << what;
  EXPECT_NEAR(static_cast<double>(coverage.inside95) / coverage.num, 0.95, Band(0.95, coverage.num)) << what;
  EXPECT_NEAR(coverage.chi_squared / coverage.degrees_of_freedom, 1, 3 * std::sqrt(2 / coverage.degrees_of_freedom)) << what;
}

TEST(Covariance, CoversAtEveryParallax) {
  for (const double deg : {4.1, 9.4, 20.0, 45.0, 90.0, 135.0, 170.0, 172.0, 174.0}) {
    ExpectHonest(Measure(TwoCameras(DegToRad(deg)), 1.0, 17), std::to_string(deg) + " deg");
    ExpectHonest(MeasureBatch(TwoCameras(DegToRad(deg)), 1.0, 19), std::to_string(deg) + " deg, batch");
  }
}

TEST(Covariance, CoversForManyCamerasAndLevelsOfNoise) {
  for (const int num_cameras : {3, 4, 8}) {
    for (const double noise_px : {0.01, 1.0, 5.0}) {
      ExpectHonest(Measure(MakeRing(num_cameras), noise_px, 23),
                   std::to_string(num_cameras) + " cameras, " + std::to_string(noise_px));
    }
  }
}

// Repeating a camera's image brings no knowledge.
TEST(Covariance, ARepeatedImageCountsOnce) {
  geometry::Rig rig = MakeRing(4);
  rig.cameras.push_back(rig.cameras[2]);
  rig.cameras.back().camera.name = "again";
  const PreparedRig prepared = Prepare(rig);
  Rng rng(37);
  std::vector<Observation> observations = Observe(rig, RandomPoint(&rng), 1.0, &rng);
  observations[4].px = observations[2].px;
  const Point repeated = TriangulatePoint(prepared, observations);
  observations.pop_back();
  const Point once = TriangulatePoint(prepared, observations);
  ASSERT_EQ(repeated.status, Status::kOk);
  EXPECT_EQ(repeated.used, once.used);
  EXPECT_EQ(repeated.covariance, once.covariance);
}

TEST(Covariance, WeighsCamerasByTheirNoise) {
  const geometry::Rig rig = MakeRing(6);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(29);
  int inside95 = 0;
  double weighted = 0, plain = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::Vector3d truth = RandomPoint(&rng);
    std::vector<Observation> observations = Observe(rig, truth);
    for (Observation& seen : observations) {
      seen.sigma_px = seen.camera_idx < 3 ? 0.5 : 4;
      seen.px += seen.sigma_px * Eigen::Vector2d(rng.Normal(), rng.Normal());
    }
    const Point point = TriangulatePoint(prepared, observations);
    ASSERT_EQ(point.status, Status::kOk);
    const Eigen::Vector3d error = point.x_in_world - truth;
    inside95 += error.dot(point.covariance.inverse() * error) < kChiSquared95;
    weighted += error.squaredNorm();
    for (Observation& seen : observations) seen.sigma_px = 4;
    plain += (TriangulatePoint(prepared, observations).x_in_world - truth).squaredNorm();
  }
  EXPECT_NEAR(static_cast<double>(inside95) / kTrials, 0.95, Band(0.95, kTrials));
  EXPECT_LT(weighted, 0.3 * plain);
}

TEST(Noise, ChiSquaredMedians) {  // R: qchisq(0.5, df)
  EXPECT_NEAR(ChiSquaredMedian(1), 0.4549364, 1e-6);
  EXPECT_NEAR(ChiSquaredMedian(3), 2.3659739, 3e-3);
  EXPECT_NEAR(ChiSquaredMedian(13), 12.3397559, 3e-3);
}

TEST(Noise, IsFoundFromTheResiduals) {
  const geometry::Rig rig = MakeRing(8);
  for (const double noise_px : {0.05, 1.0, 6.0}) {
    for (const double outliers : {0.0, 0.1}) {
      Rng rng(31);
      std::vector<std::vector<Observation>> points;
      for (int i = 0; i < 600; ++i) {
        points.push_back(Observe(rig, RandomPoint(&rng), noise_px, &rng));
        for (Observation& seen : points.back()) {
          if (rng.Uniform() < outliers) seen.px = {rng.Uniform(0, 1279), rng.Uniform(0, 959)};
        }
      }
      const double scale = EstimateNoiseScale(Prepare(rig), points, {}, 8, 1, 1);
      // 600 points of 13 degrees of freedom: the median's own standard deviation is about 1 %; outliers add a little.
      EXPECT_NEAR(scale / noise_px, 1, outliers > 0 ? 0.08 : 0.04) << noise_px << " px, outliers " << outliers;
    }
  }
}

TEST(Noise, FallsBackWithoutPoints) { EXPECT_EQ(EstimateNoiseScale(Prepare(MakeRing(3)), {}, {}, 8, 2.5, 1), 2.5); }

}  // namespace
}  // namespace mvstudio::triangulate
