#include "geometry/rigid/rigid3.h"

#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/random.h"
#include "core/units.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

Eigen::Vector3d RandomUnit(Rng& rng) { return Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal()).normalized(); }

Rigid3 RandomRigid(Rng& rng) { return {RotationExp(RandomUnit(rng) * rng.Uniform(0, kPi)), 5 * RandomUnit(rng)}; }

TEST(Rotation, LogInvertsExpFromTheTiniestAngleToPi) {
  Rng rng(1);
  for (const double angle : {0.0, 1e-300, 1e-154, 1e-16, 1e-8, 1e-4, 0.5, 3.0, kPi - 1e-4, kPi - 1e-10, kPi - 1e-15}) {
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d v = RandomUnit(rng) * angle;
      const Eigen::Vector3d back = RotationLog(RotationExp(v));
      ASSERT_LE((back - v).norm(), 4e-16 * std::max(angle, 0.0) * 4) << angle;
    }
  }
}

TEST(Rotation, LogChoosesTheShortWay) {
  for (const double angle : {kPi + 1e-10, kPi + 0.5, 2 * kPi - 1e-10}) {
    const Eigen::Vector3d v = RotationLog(RotationExp(Eigen::Vector3d(0, 0, angle)));
    EXPECT_NEAR(v[2], angle - 2 * kPi, 1e-15) << angle;
  }
  const Eigen::Vector3d half_turn = RotationLog(Eigen::Quaterniond(0, 0.6, 0.8, 0));
  EXPECT_NEAR(half_turn.norm(), kPi, 1e-15);
}

TEST(Rotation, ExpAgreesWithTheAxisAngleMatrix) {
  Rng rng(2);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d axis = RandomUnit(rng);
    const double angle = rng.Uniform(0, 6);
    EXPECT_LT((RotationExp(axis * angle).toRotationMatrix() - Eigen::AngleAxisd(angle, axis).toRotationMatrix()).norm(), 1e-14);
  }
}

TEST(Rotation, AngleIsAccurateForTinyDifferences) {
  const Eigen::Quaterniond a = RotationExp({0.3, -1.2, 0.7});
  EXPECT_EQ(RotationAngle(a, a), 0);
  for (const double angle : {1e-12, 1e-6, 1.0, 3.1})
    EXPECT_NEAR(RotationAngle(RotationExp({0, angle, 0}) * a, a), angle, 1e-15 * 4);
  EXPECT_EQ(RotationAngle(a, Eigen::Quaterniond(-a.coeffs())), 0) << "q and -q are the same rotation";
}

TEST(Rigid3, ComposesInvertsAndActsAsItsMatrix) {
  Rng rng(3);
  for (int i = 0; i < 100; ++i) {
    const Rigid3 b_from_a = RandomRigid(rng), c_from_b = RandomRigid(rng);
    const Eigen::Vector3d x_in_a = 3 * RandomUnit(rng);
    EXPECT_LT((((c_from_b * b_from_a) * x_in_a) - (c_from_b * (b_from_a * x_in_a))).norm(), 1e-14 * 10);
    EXPECT_LT((ToMatrix(c_from_b * b_from_a) - ToMatrix(c_from_b) * ToMatrix(b_from_a)).norm(), 1e-14 * 10);
    EXPECT_LT((Inverse(b_from_a) * (b_from_a * x_in_a) - x_in_a).norm(), 1e-14 * 10);
  }
}

TEST(Rigid3, AMillionCompositionsStayOnTheGroup) {
  const Rigid3 step = {RotationExp({1e-3, 2e-3, -1e-3}), {0, 0, 0}};
  Rigid3 total;
  for (int i = 0; i < 1000000; ++i) total = step * total;
  EXPECT_NEAR(total.rotation.norm(), 1, 1e-15);
  const Eigen::Quaterniond expected = RotationExp(Eigen::Vector3d(1e-3, 2e-3, -1e-3) * 1e6);
  EXPECT_LT(RotationAngle(total.rotation, expected), 1e-9);
}

TEST(Rigid3, PerturbsOnTheLeft) {
  Rng rng(4);
  const Rigid3 b_from_a = RandomRigid(rng);
  Vector6d delta;
  delta << 1e-3, -2e-3, 3e-3, 0.1, 0.2, -0.3;
  const Rigid3 moved = Perturb(delta, b_from_a);
  EXPECT_LT((moved.rotation.toRotationMatrix() -
             RotationExp(delta.head<3>()).toRotationMatrix() * b_from_a.rotation.toRotationMatrix())
                .norm(),
            1e-15 * 10);
  EXPECT_EQ(moved.translation, b_from_a.translation + delta.tail<3>());
}

TEST(NearestRotation, KeepsRotationsAndReportsDrift) {
  Rng rng(5);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Matrix3d rotation = RandomRigid(rng).rotation.toRotationMatrix();
    double drift = -1;
    EXPECT_LT((NearestRotation(rotation, &drift).toRotationMatrix() - rotation).norm(), 1e-14);
    EXPECT_LT(drift, 1e-14);
    // Symmetric stretch S leaves R the polar factor of S R, at distance |S - I|.
    const Eigen::Matrix3d stretch = Eigen::Vector3d(1.1, 1.0, 0.9).asDiagonal();
    EXPECT_LT((NearestRotation(stretch * rotation, &drift).toRotationMatrix() - rotation).norm(), 1e-14);
    EXPECT_NEAR(drift, std::sqrt(0.02), 1e-14);
  }
}

TEST(NearestRotation, RefusesReflectionsSingularAndNonFiniteMatrices) {
  EXPECT_THROW(NearestRotation(-Eigen::Matrix3d::Identity()), ContractViolation);
  EXPECT_THROW(NearestRotation(Eigen::Matrix3d::Zero()), ContractViolation);
  EXPECT_THROW(NearestRotation(Eigen::Matrix3d::Ones()), ContractViolation);
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  matrix(1, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(NearestRotation(matrix), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::geometry
