#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cstdio>
#include <limits>

#include "tests/triangulate/support.h"
#include "triangulate/point/point.h"

namespace mvstudio::triangulate {
namespace {

constexpr double kChiSquared9999 = 21.1075;  // 3 degrees of freedom

struct Tally {
  int right = 0, wrong = 0, refused = 0;
};

/// Random pixels in place of `num_outliers` of the cameras. Right: the truth lies in the 99.99 % ellipsoid.
Tally TryOutliers(int num_cameras, int num_outliers, int trials, uint64_t seed) {
  const geometry::Rig rig = MakeRing(num_cameras);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(seed);
  Tally tally;
  for (int trial = 0; trial < trials; ++trial) {
    const Eigen::Vector3d truth = RandomPoint(&rng);
    std::vector<Observation> observations = Observe(rig, truth, 1.0, &rng);
    std::vector<int> order(observations.size());
    for (size_t i = 0; i < order.size(); ++i) {
      order[i] = static_cast<int>(i);
      std::swap(order[i], order[rng.Index(static_cast<int64_t>(i) + 1)]);
    }
    for (int k = 0; k < num_outliers; ++k) observations[order[k]].px = {rng.Uniform(0, 1279), rng.Uniform(0, 959)};
    PointOptions options;
    options.seed = static_cast<uint64_t>(trial);
    const Point point = TriangulatePoint(prepared, observations, options);
    if (point.status != Status::kOk) {
      ++tally.refused;
      continue;
    }
    const Eigen::Vector3d error = point.x_in_world - truth;
    (error.dot(point.covariance.inverse() * error) < kChiSquared9999 ? tally.right : tally.wrong) += 1;
  }
  return tally;
}

TEST(RobustSelection, FindsThePointUpToSixtyPercentOutliers) {
  for (int num_outliers = 0; num_outliers <= 6; ++num_outliers) {
    const Tally tally = TryOutliers(10, num_outliers, 300, 41);
    EXPECT_GE(tally.right, 297) << num_outliers << " of 10 views: wrong " << tally.wrong << ", refused " << tally.refused;
  }
}

// Shares of right and wrong answers of 3 to 31 views; a wrong answer is one that claims to be right.
TEST(RobustSelection, SeldomTellsAPlausibleLie) {
  int num_answers = 0, num_wrong = 0;
  for (const int num_cameras : {3, 4, 5, 6, 8, 12, 31}) {
    for (const int percent : {0, 10, 20, 30, 40, 50, 60}) {
      const int num_outliers = num_cameras * percent / 100;
      const int trials = num_cameras < 31 ? 400 : 60;
      const Tally tally = TryOutliers(num_cameras, num_outliers, trials, 101);
      std::printf("%2d views, %2d wrong: right %5.1f %%, refused %5.1f %%, wrong %4.1f %%\n", num_cameras, num_outliers,
                  100.0 * tally.right / trials, 100.0 * tally.refused / trials, 100.0 * tally.wrong / trials);
      num_answers += tally.right + tally.wrong;
      num_wrong += tally.wrong;
      // Of three or four views any two may agree by chance.
      EXPECT_LE(tally.wrong, (num_cameras > 4 ? 0.01 : 0.03) * trials) << num_outliers << " of " << num_cameras;
      if (num_cameras <= 4) continue;
      if (num_cameras - num_outliers >= 3) {  // of more than four views, three must agree
        EXPECT_GE(tally.right, 0.98 * trials) << num_outliers << " of " << num_cameras;
      } else {
        EXPECT_GE(tally.refused, 0.98 * trials) << num_outliers << " of " << num_cameras;
      }
    }
  }
  EXPECT_LT(num_wrong, 0.005 * num_answers);
}

TEST(RobustSelection, TwoEquallySupportedPointsAreRefused) {
  const geometry::Rig rig = MakeRing(8);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(103);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Vector3d truth = RandomPoint(&rng), other = truth + Eigen::Vector3d(0.3, -0.2, 0.05);
    std::vector<Observation> observations = Observe(rig, truth, 1.0, &rng);
    const std::vector<Observation> swapped = Observe(rig, other, 1.0, &rng);
    for (int k = 0; k < 4; ++k) observations[(trial + 2 * k) % 8].px = swapped[(trial + 2 * k) % 8].px;
    EXPECT_EQ(TriangulatePoint(prepared, observations).status, Status::kOutlier);
  }
}

TEST(RobustSelection, EveryMethodCanChooseItsViews) {
  const geometry::Rig rig = MakeRing(9);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(107);
  for (const PointMethod method : kAllPointMethods) {
    int num_right = 0;
    for (int trial = 0; trial < 50; ++trial) {
      const Eigen::Vector3d truth = RandomPoint(&rng);
      std::vector<Observation> observations = Observe(rig, truth, 0.5, &rng);
      for (const int wrong : {2, 5, 7}) observations[wrong].px = {rng.Uniform(0, 1279), rng.Uniform(0, 959)};
      PointOptions options;
      options.method = method;
      options.select_views = true;
      const Point point = TriangulatePoint(prepared, observations, options);
      num_right += point.status == Status::kOk && (point.x_in_world - truth).norm() < 0.02;
    }
    EXPECT_GE(num_right, 45) << ToString(method);
  }
}

TEST(RobustSelection, BrokenNumbersAmongOutliers) {
  const geometry::Rig rig = MakeRing(10);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(109);
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Vector3d truth = RandomPoint(&rng);
    std::vector<Observation> observations = Observe(rig, truth, 1.0, &rng);
    observations[0].px = {nan, nan};
    observations[2].px.y() = infinity;
    observations[4].sigma_px = infinity;  // what a confidence of zero amounts to
    observations[6].sigma_px = nan;
    observations[7].px = {rng.Uniform(0, 1279), rng.Uniform(0, 959)};
    const Point point = TriangulatePoint(prepared, observations);
    ASSERT_EQ(point.status, Status::kOk);
    EXPECT_LT((point.x_in_world - truth).norm(), 0.03);
    for (const int used : point.used) EXPECT_TRUE(used % 2 == 1 || used == 8) << used;
  }
}

TEST(RobustSelection, FewViews) {
  const Tally of_three = TryOutliers(3, 1, 500, 43);
  const Tally of_four = TryOutliers(4, 1, 500, 43);
  const Tally of_six = TryOutliers(6, 2, 300, 43);
  // With three views, any two agree when the wrong one happens to lie near an epipolar line: refused where it can be noticed.
  EXPECT_LE(of_three.wrong, 15) << "refused " << of_three.refused;
  EXPECT_GE(of_three.right, 400) << "refused " << of_three.refused;
  EXPECT_GE(of_four.right, 490) << "wrong " << of_four.wrong << ", refused " << of_four.refused;
  EXPECT_GE(of_six.right, 295) << "wrong " << of_six.wrong << ", refused " << of_six.refused;
}

TEST(RobustSelection, RefusesBeyondTheBreakdown) {
  for (const int num_outliers : {8, 9, 10}) {
    const Tally tally = TryOutliers(10, num_outliers, 300, 47);
    EXPECT_LE(tally.wrong, 15) << num_outliers << " of 10 views, right " << tally.right;
  }
}

TEST(RobustSelection, ManyCameras) {
  const Tally of_31 = TryOutliers(31, 15, 100, 53);
  EXPECT_EQ(of_31.right, 100) << "wrong " << of_31.wrong;
  const Tally of_520 = TryOutliers(520, 260, 10, 59);
  EXPECT_EQ(of_520.right, 10) << "wrong " << of_520.wrong;
}

TEST(RobustSelection, MajorityWinsAgainstASecondConsistentPoint) {
  const geometry::Rig rig = MakeRing(8);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(61);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Vector3d truth = RandomPoint(&rng), other = truth + Eigen::Vector3d(0.3, -0.2, 0.05);
    std::vector<Observation> observations = Observe(rig, truth, 1.0, &rng);
    const std::vector<Observation> swapped = Observe(rig, other, 1.0, &rng);
    for (int k = 0; k < 3; ++k) observations[(trial + 2 * k) % 8].px = swapped[(trial + 2 * k) % 8].px;
    const Point point = TriangulatePoint(prepared, observations);
    ASSERT_EQ(point.status, Status::kOk);
    EXPECT_EQ(point.used.size(), 5u);
    EXPECT_LT((point.x_in_world - truth).norm(), 0.03);
  }
}

TEST(RobustSelection, TwoViewsThatDisagreeAreAnOutlier) {
  const geometry::Rig rig = TwoCameras(DegToRad(60));
  std::vector<Observation> observations = Observe(rig, {0.1, 0.1, 0.1});
  observations[1].px.y() += 30;
  EXPECT_EQ(TriangulatePoint(Prepare(rig), observations).status, Status::kOutlier);
  PointOptions trusting;
  trusting.method = PointMethod::kAllViews;
  EXPECT_EQ(TriangulatePoint(Prepare(rig), observations, trusting).status, Status::kOk);
}

TEST(RobustSelection, AmbiguousPairsAreRefused) {
  // Three cameras in one plane with the point: moving the middle one's pixel along the plane keeps every pair consistent.
  geometry::Rig rig;
  for (const double deg : {-30.0, 0.0, 30.0}) {
    rig.cameras.push_back(
        LookAt("c" + std::to_string(deg), 3 * Eigen::Vector3d(std::cos(DegToRad(deg)), std::sin(DegToRad(deg)), 0), {0, 0, 0}));
  }
  std::vector<Observation> observations = Observe(rig, {0, 0, 0});
  observations[1].px.x() += 80;
  EXPECT_EQ(TriangulatePoint(Prepare(rig), observations).status, Status::kOutlier);
}

}  // namespace
}  // namespace mvstudio::triangulate
