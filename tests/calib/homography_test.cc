#include "calib/board/homography.h"

#include <Eigen/Geometry>

#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

Eigen::Matrix2Xd GridPoints(int cols, int rows) {
  Eigen::Matrix2Xd points(2, cols * rows);
  for (int i = 0; i < cols * rows; ++i) points.col(i) << i % cols, i / cols;
  return points;
}

Eigen::Matrix2Xd MapAll(const Eigen::Matrix3d& h, const Eigen::Matrix2Xd& from) {
  return (h * from.colwise().homogeneous()).colwise().hnormalized();
}

TEST(FitHomography, RecoversAnExactOne) {
  Eigen::Matrix3d truth;
  truth << 40, 3, 300, -5, 38, 200, 0.01, -0.02, 1;
  const Eigen::Matrix2Xd from = GridPoints(5, 4), to = MapAll(truth, from);
  const auto fit = FitHomography(from, to);
  ASSERT_TRUE(fit);
  EXPECT_LT((MapAll(*fit, from) - to).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(FitHomography, FourPointsAreEnoughThreeAreNot) {
  const Eigen::Matrix2Xd from = GridPoints(2, 2);
  EXPECT_TRUE(FitHomography(from, 30 * from));
  EXPECT_FALSE(FitHomography(from.leftCols(3), from.leftCols(3)));
}

TEST(FitHomography, RefusesCollinearAndNonFinite) {
  Eigen::Matrix2Xd line = GridPoints(6, 1);
  EXPECT_FALSE(FitHomography(line, 3 * line));
  Eigen::Matrix2Xd bad = GridPoints(3, 3);
  bad(0, 4) = std::nan("");
  EXPECT_FALSE(FitHomography(GridPoints(3, 3), bad));
}

TEST(PlaneToImage, FollowsALensAndFlagsASingleBadCorner) {
  const Eigen::Matrix2Xd from = GridPoints(9, 6);
  Eigen::Matrix2Xd to(2, from.cols());
  for (int i = 0; i < from.cols(); ++i) {
    const Eigen::Vector2d p = (from.col(i) - Eigen::Vector2d(4, 2.5)) / 8;
    to.col(i) = 500 * p * (1 - 0.3 * p.squaredNorm()) + Eigen::Vector2d(320, 240);
  }
  to.col(17) += Eigen::Vector2d(2, -1);
  const auto fit = PlaneToImage::Fit(from, to);
  ASSERT_TRUE(fit);
  EXPECT_GT(fit->homography_median_px(), 0.2) << "the lens bends the plane";
  EXPECT_LT(fit->sigma_px(), 0.02);
  for (int i = 0; i < from.cols(); ++i) EXPECT_NEAR(fit->residuals_px()[i], i == 17 ? std::sqrt(5.0) : 0, 0.25) << i;
}

TEST(Median, UpperMiddle) {
  EXPECT_EQ(Median(Eigen::Vector3d(3, 1, 2)), 2);
  EXPECT_EQ(Median(Eigen::VectorXd()), 0);
}

}  // namespace
}  // namespace mvstudio::calib
