#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "tests/triangulate/oracle.h"
#include "tests/triangulate/support.h"
#include "triangulate/batch/batch.h"
#include "triangulate/point/solvers.h"

namespace mvstudio::triangulate {
namespace {

const double kAnglesDeg[] = {0.01, 0.03, 0.1, 0.3, 0.5, 1,   2,   4.1, 9.4,   20,    45,    60,     90,    120,
                             135,  150,  160, 170, 172, 176, 178, 179, 179.5, 179.7, 179.9, 179.97, 179.99};

/// The status that the optimum in 60 digits deserves: depth known to a fifth of the distance, seen from ahead.
Status Deserved(const geometry::Rig& rig, const oracle::Optimum& best, double min_parallax_sigmas) {
  Eigen::Matrix3d covariance;
  const oracle::Matrix3 exact = best.information.inverse();
  double nearest = 1e300;
  for (const geometry::RigCamera& camera : rig.cameras) {
    if (!(oracle::ToCam(camera, best.x_in_world)[2] > 0)) return Status::kBehindCamera;
    nearest = std::min(nearest, static_cast<double>((best.x_in_world - oracle::Center(camera)).norm()));
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) covariance(i, j) = static_cast<double>(exact(i, j));
  }
  const double variance = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues()[2];
  return std::sqrt(variance) * min_parallax_sigmas > nearest ? Status::kLowParallax : Status::kOk;
}

/// One noisy point at each angle: the right status, and where there is a point the optimum to 1e-6 of its standard deviation.
void Sweep(double sigma_px, int* num_ok, int* num_low) {
  Rng rng(3);
  for (const double deg : kAnglesDeg) {
    const geometry::Rig rig = TwoCameras(DegToRad(deg));
    std::vector<Observation> observations = Observe(rig, Eigen::Vector3d(0.01, -0.02, 0.1), sigma_px, &rng, sigma_px);
    const Point point = TriangulatePoint(Prepare(rig), observations, {PointMethod::kAllViews});
    if (point.status != Status::kOk) {
      // Close to the threshold and below it the sign of the depth may be noise: any other answer than Ok is right there.
      EXPECT_EQ(point.status, Status::kLowParallax) << deg << " deg, " << sigma_px << " px";
      EXPECT_LT(std::sin(DegToRad(deg)), 8 * sigma_px / 1000) << deg << " deg, " << sigma_px << " px";
      ++*num_low;
      continue;
    }
    ++*num_ok;
    const oracle::Optimum best = oracle::MostLikely(rig, observations, point.x_in_world);
    EXPECT_EQ(Deserved(rig, best, 5), Status::kOk) << deg << " deg, " << sigma_px << " px";
    const Eigen::Vector3d apart = point.x_in_world - oracle::ToDouble(best.x_in_world);
    EXPECT_LT(std::sqrt(apart.dot(point.covariance.inverse() * apart)), 1e-6) << deg << " deg, " << sigma_px << " px";
    EXPECT_NEAR(point.chi_squared, static_cast<double>(best.chi_squared), 1e-6 * (1 + point.chi_squared)) << deg;
  }
}

TEST(Parallax, StatusAndPointAtEveryAngle) {
  for (const double sigma_px : {1.0, 0.1, 0.01, 1e-4}) {
    int num_ok = 0, num_low = 0;
    Sweep(sigma_px, &num_ok, &num_low);
    if (sigma_px == 1.0) {
      EXPECT_GT(num_low, 3);
    }
    EXPECT_GT(num_ok, sigma_px < 0.1 ? 26 : 15) << sigma_px;
  }
}

// Noise-free: every solver finds the point wherever rays cross at all; its digits fall with the sine of the parallax.
TEST(Parallax, EverySolverKeepsItsDigits) {
  for (const double deg : kAnglesDeg) {
    const geometry::Rig rig = TwoCameras(DegToRad(deg));
    const PreparedRig prepared = Prepare(rig);
    const Eigen::Vector3d truth(0.01, -0.02, 0.1);
    const std::vector<Observation> observations = Observe(rig, truth, 0, nullptr, 1e-6);
    for (const PointMethod method : kAllPointMethods) {
      PointOptions options;
      options.method = method;
      const Point point = TriangulatePoint(prepared, observations, options);
      ASSERT_EQ(point.status, Status::kOk) << ToString(method) << ", " << deg << " deg";
      const double sine = std::sin(DegToRad(deg));
      EXPECT_LT((point.x_in_world - truth).norm(), 1e-13 / (sine * sine)) << ToString(method) << ", " << deg << " deg";
    }
  }
}

TEST(Parallax, BatchDecidesAlike) {
  for (const double deg : kAnglesDeg) {
    const geometry::Rig rig = TwoCameras(DegToRad(deg));
    const PreparedRig prepared = Prepare(rig);
    Rng rng(5);
    PointBatch batch = MakeBatch(2, 40);
    std::vector<Status> expected;
    for (int64_t i = 0; i < batch.num_points; ++i) {
      const std::vector<Observation> seen = Observe(rig, RandomPoint(&rng, 0.1), 1.0, &rng);
      for (const Observation& each : seen) {
        batch.x_px[each.camera_idx * 40 + i] = each.px.x();
        batch.y_px[each.camera_idx * 40 + i] = each.px.y();
      }
      expected.push_back(TriangulatePoint(prepared, seen).status);
    }
    const BatchResult result = TriangulateBatch(prepared, batch);
    for (int64_t i = 0; i < batch.num_points; ++i) EXPECT_EQ(result.StatusOf(i), expected[i]) << deg << " deg";
  }
}

TEST(Parallax, ManyViewsOfOneDirection) {
  for (const int num_views : {2, 10, 100, 520}) {
    geometry::Rig rig;
    for (int i = 0; i < num_views; ++i) {  // 1 mm apart, 3 m from the point: 520 cameras within 10 degrees
      const double y = 1e-3 * i;
      rig.cameras.push_back(LookAt("c" + std::to_string(i), {0, y, 0}, {3, y, 0}));
    }
    const Eigen::Vector3d truth(3, 1e-3 * num_views / 2, 0.05);
    const std::vector<Observation> observations = Observe(rig, truth);
    ASSERT_EQ(static_cast<int>(observations.size()), num_views);
    const Status expected = Deserved(rig, oracle::MostLikely(rig, observations, truth, 1), 5);
    EXPECT_EQ(expected, num_views < 50 ? Status::kLowParallax : Status::kOk);
    EXPECT_EQ(TriangulatePoint(Prepare(rig), observations).status, expected) << num_views;
  }
}

}  // namespace
}  // namespace mvstudio::triangulate
