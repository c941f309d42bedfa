#include "geometry/rigid/decompositions.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/random.h"
#include "geometry/rigid/rigid3.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

Eigen::Matrix3d RandomMatrix(Rng* rng) {
  Eigen::Matrix3d m;
  for (int i = 0; i < 9; ++i) m.data()[i] = rng->Normal();
  return m;
}

TEST(Decompositions, ProcrustesRotationIsARotationAndNoOtherIsNearer) {
  Rng rng(1);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Matrix3d m = RandomMatrix(&rng), r = ProcrustesRotation(m);
    EXPECT_LT((r * r.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_NEAR(r.determinant(), 1, 1e-12);
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d turn(rng.Normal(), rng.Normal(), rng.Normal());
      EXPECT_LE((RotationExp(turn).toRotationMatrix() * r).cwiseProduct(m).sum(), r.cwiseProduct(m).sum() + 1e-12);
    }
  }
}

TEST(Decompositions, ARotationIsItsOwnNearest) {
  const Eigen::Matrix3d r = RotationExp(Eigen::Vector3d(0.3, -2, 1)).toRotationMatrix();
  EXPECT_LT((ProcrustesRotation(1e-9 * r) - r).norm(), 1e-12);
  EXPECT_LT((ProcrustesRotation(1e9 * r) - r).norm(), 1e-12);
}

TEST(Decompositions, SingularValuesOfWideAndTallMatrices) {
  Eigen::MatrixXd wide(2, 3);
  wide << 3, 0, 0, 0, 0, 1e-9;
  EXPECT_NEAR(SingularValues(wide)[0], 3, 1e-14);
  EXPECT_NEAR(SingularValues(wide)[1], 1e-9, 1e-22);
  EXPECT_NEAR(SingularValues(wide.transpose())[1], 1e-9, 1e-22);
}

TEST(Decompositions, SymmetricEigenvaluesAscend) {
  const Eigen::Matrix3d r = RotationExp(Eigen::Vector3d(1, 2, -0.5)).toRotationMatrix();
  const Eigen::Vector3d values = SymmetricEigenvalues(r * Eigen::Vector3d(5, -1, 2).asDiagonal() * r.transpose());
  EXPECT_LT((values - Eigen::Vector3d(-1, 2, 5)).norm(), 1e-12);
}

}  // namespace
}  // namespace mvstudio::geometry
