#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "core/statistics.h"
#include "tests/triangulate/support.h"
#include "triangulate/budget/reliability.h"
#include "triangulate/budget/shapley.h"

/// Shares of stages and the calibration of sigmas, against closed forms.
namespace mvstudio::triangulate {
namespace {

TEST(ShapleyShares, OfThreePlayersAreThoseOfTheGlovesGame) {
  // One left glove, two right ones: a pair is worth 1. Shapley's values are 2/3, 1/6, 1/6 (Osborne and Rubinstein, 1994).
  std::vector<double> error_of;
  for (int set = 0; set < 8; ++set) error_of.push_back((set & 1) && (set & 6) ? 0 : 1);
  const std::vector<double> shares = ShapleyShares(error_of);
  ASSERT_EQ(shares.size(), 3u);
  EXPECT_NEAR(shares[0], 2.0 / 3, 1e-15);
  EXPECT_NEAR(shares[1], 1.0 / 6, 1e-15);
  EXPECT_NEAR(shares[2], 1.0 / 6, 1e-15);
}

TEST(ShapleyShares, SumToTheWholeAndAreTheTermsOfASum) {
  Rng rng(3);
  for (int n = 1; n <= 6; ++n) {
    std::vector<double> any(size_t{1} << n), sum(any.size());
    for (double& value : any) value = rng.Uniform(-2, 5);
    for (size_t set = 0; set < sum.size(); ++set) {
      for (int i = 0; i < n; ++i) sum[set] += set >> i & 1 ? 0 : i + 1;
    }
    double total = 0;
    for (const double share : ShapleyShares(any)) total += share;
    EXPECT_NEAR(total, any.front() - any.back(), 1e-12);
    for (int i = 0; i < n; ++i) EXPECT_NEAR(ShapleyShares(sum)[static_cast<size_t>(i)], i + 1, 1e-12);
  }
}

std::vector<double> SquaredNormals(int count, double factor, int degrees_of_freedom) {
  Rng rng(7);
  std::vector<double> squared(static_cast<size_t>(count));
  for (double& value : squared) {
    for (int k = 0; k < degrees_of_freedom; ++k) value += std::pow(factor * rng.Normal(), 2);
  }
  return squared;
}

TEST(Reliability, TrueSigmasHaveNoErrorBeyondChance) {
  for (const int dof : {1, 3}) {
    const Reliability result = MeasureReliability(SquaredNormals(20000, 1, dof), dof);
    EXPECT_EQ(result.num, 20000);
    EXPECT_LT(result.error, 4 * result.chance);
    EXPECT_LT(result.chance, 0.003);
    EXPECT_NEAR(result.sigma_factor, 1, 0.02);
  }
}

TEST(Reliability, OfSigmasHalfAsLargeAsTheErrorsIsTheClosedForm) {
  // Stated within z sigma, the errors are within z / 2: P(|x| < q) = erf(q / sqrt 2). z by bisection of erf.
  double expected = 0;
  for (int k = 1; k <= 19; ++k) {
    const double stated = k / 20.0;
    double low = 0, high = 10;
    for (int i = 0; i < 80; ++i) (std::erf((low + high) / 2 / std::sqrt(2)) < stated ? low : high) = (low + high) / 2;
    expected += std::abs(stated - std::erf(low / 2 / std::sqrt(2))) / 19;
  }
  const Reliability result = MeasureReliability(SquaredNormals(40000, 2, 1), 1);
  EXPECT_GT(expected, 0.15);
  EXPECT_NEAR(result.error, expected, 0.006);
  EXPECT_NEAR(result.sigma_factor, 2, 0.04);
  for (size_t k = 0; k < result.stated.size(); ++k) EXPECT_LT(result.observed[k], result.stated[k]);
}

TEST(Reliability, ProbabilitiesAreThoseOfTheTables) {
  EXPECT_NEAR(ChiSquaredProbability(3.841459, 1), 0.95, 1e-6);
  EXPECT_NEAR(ChiSquaredProbability(7.814728, 3), 0.95, 1e-6);
  EXPECT_NEAR(ChiSquaredProbability(2.365974, 3), 0.5, 1e-6);
  EXPECT_TRUE(std::isnan(MeasureReliability({}, 1).error));
}

TEST(Reliability, PosesOfRigsDrawnFromTheirCovarianceAreWhite) {
  geometry::Rig truth = MakeRing(4);
  Rng rng(11);
  Eigen::Matrix<double, 6, 1> sigmas;
  sigmas << 1e-3, 2e-3, 1e-3, 4e-3, 3e-3, 5e-3;
  const Eigen::MatrixXd covariance = sigmas.cwiseAbs2().asDiagonal();
  for (auto& camera : truth.cameras) camera.cam_from_world_covariance = covariance;
  std::vector<double> squared, doubled;
  for (int k = 0; k < 200; ++k) {
    geometry::Rig drawn = DrawRig(truth, &rng);
    const std::vector<double> white = WhitenedPoses(drawn, truth);
    ASSERT_EQ(white.size(), 18u);
    for (const double z : white) squared.push_back(z * z);
    for (auto& camera : drawn.cameras) *camera.cam_from_world_covariance /= 4;
    for (const double z : WhitenedPoses(drawn, truth)) doubled.push_back(z * z);
  }
  EXPECT_NEAR(Mean(squared), 1, 0.08);  // of 3600 squares: sigma sqrt(2 / 3600) = 0.024
  EXPECT_LT(MeasureReliability(squared, 1).error, 0.02);
  EXPECT_NEAR(MeasureReliability(doubled, 1).sigma_factor, 2, 0.15);
  truth.cameras[2].cam_from_world_covariance.reset();
  EXPECT_TRUE(WhitenedPoses(truth, truth).empty());
}

}  // namespace
}  // namespace mvstudio::triangulate
