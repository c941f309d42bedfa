#include "geometry/rig/alignment.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

Eigen::Matrix3Xd RandomPoints(Rng& rng, int count) {
  Eigen::Matrix3Xd points(3, count);
  for (Eigen::Index i = 0; i < points.size(); ++i) points.data()[i] = rng.Normal();
  return points;
}

Eigen::Matrix3Xd Moved(const Rigid3& b_from_a, double scale, const Eigen::Matrix3Xd& x_in_a) {
  return (scale * (b_from_a.rotation.toRotationMatrix() * x_in_a)).colwise() + b_from_a.translation;
}

const Rigid3 kTruth = {RotationExp({0.4, -2.1, 1.3}), {3, -7, 0.5}};

TEST(AlignPoints, RecoversRigidMotionsAndSimilarities) {
  Rng rng(1);
  for (const int count : {3, 4, 50}) {
    for (const double scale : {1.0, 0.01, 120.0}) {
      const Eigen::Matrix3Xd a = RandomPoints(rng, count);
      const Rigid3 truth = {kTruth.rotation, scale * kTruth.translation};
      const Alignment result = AlignPoints(a, Moved(truth, scale, a), scale != 1);
      ASSERT_EQ(result.status, Status::kOk);
      EXPECT_NEAR(result.scale / scale, 1, 1e-14);
      EXPECT_LT(RotationAngle(result.b_from_a.rotation, truth.rotation), 1e-13);
      EXPECT_LT((result.b_from_a.translation - truth.translation).norm(), 1e-13 * scale);
      EXPECT_LT(result.rms, 1e-14 * scale);
    }
  }
}

TEST(AlignPoints, NeverReturnsAReflection) {
  Rng rng(2);
  Eigen::Matrix3Xd a = RandomPoints(rng, 20), b = a;
  b.row(0) *= -1;
  const Alignment mirrored = AlignPoints(a, b);
  ASSERT_EQ(mirrored.status, Status::kOk);
  EXPECT_NEAR(mirrored.b_from_a.rotation.toRotationMatrix().determinant(), 1, 1e-14);
  EXPECT_GT(mirrored.rms, 0.1);
  a.row(2).setZero();  // a planar pattern
  const Alignment planar = AlignPoints(a, Moved(kTruth, 1, a));
  ASSERT_EQ(planar.status, Status::kOk);
  EXPECT_LT(planar.rms, 1e-13);
  EXPECT_NEAR(planar.b_from_a.rotation.toRotationMatrix().determinant(), 1, 1e-14);
}

TEST(AlignPoints, IsTheLeastSquaresSolution) {
  Rng rng(3);
  const Eigen::Matrix3Xd a = RandomPoints(rng, 30), b = Moved(kTruth, 1.3, a) + 0.05 * RandomPoints(rng, 30);
  for (const bool with_scale : {false, true}) {
    const Alignment best = AlignPoints(a, b, with_scale);
    const auto cost = [&](const Rigid3& transform, double scale) { return (Moved(transform, scale, a) - b).squaredNorm(); };
    const double least = cost(best.b_from_a, best.scale);
    EXPECT_NEAR(best.rms, std::sqrt(least / 30), 1e-12);
    for (int i = 0; i < 12; ++i) {
      Vector6d delta = Vector6d::Zero();
      delta[i / 2] = i % 2 ? 1e-4 : -1e-4;
      EXPECT_GT(cost(Perturb(delta, best.b_from_a), best.scale), least);
    }
    if (!with_scale) continue;
    for (const double change : {1.0001, 0.9999}) {
      // The scale acts about the centroid there, about the origin of a here: compare with the translation re-fitted.
      Rigid3 moved = best.b_from_a;
      moved.translation = b.rowwise().mean() - change * best.scale * (moved.rotation * Eigen::Vector3d(a.rowwise().mean()));
      EXPECT_GT(cost(moved, best.scale * change), least);
    }
  }
}

TEST(AlignPoints, SaysWhenThePointsDoNotDetermineIt) {
  Rng rng(4);
  EXPECT_EQ(AlignPoints(RandomPoints(rng, 2), RandomPoints(rng, 2)).status, Status::kTooFewViews);
  EXPECT_EQ(AlignPoints(Eigen::Matrix3Xd(3, 0), Eigen::Matrix3Xd(3, 0)).status, Status::kTooFewViews);
  EXPECT_THROW(AlignPoints(RandomPoints(rng, 3), RandomPoints(rng, 4)), ContractViolation);
  Eigen::Matrix3Xd line(3, 6);
  for (int i = 0; i < 6; ++i) line.col(i) = Eigen::Vector3d(1, 2, 3) + i * Eigen::Vector3d(0.1, -0.7, 0.3);
  for (const double offset : {0.0, 1e7}) {
    const Eigen::Matrix3Xd a = line.array() + offset;
    EXPECT_EQ(AlignPoints(a, Moved(kTruth, 1, a)).status, Status::kDegenerate) << offset;
  }
  EXPECT_EQ(AlignPoints(Eigen::Matrix3Xd::Ones(3, 5), Eigen::Matrix3Xd::Ones(3, 5)).status, Status::kDegenerate);
  Eigen::Matrix3Xd bad = RandomPoints(rng, 5);
  bad(1, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(AlignPoints(bad, RandomPoints(rng, 5)).status, Status::kNonFiniteInput);
}

TEST(AlignPoints, SurvivesExtremeUnits) {
  Rng rng(5);
  const Eigen::Matrix3Xd a = RandomPoints(rng, 10);
  for (const double unit : {1e-200, 1e-9, 1e9, 1e200}) {
    const Alignment result = AlignPoints(a * unit, Moved({kTruth.rotation, Eigen::Vector3d::Zero()}, 1, a * unit));
    ASSERT_EQ(result.status, Status::kOk) << unit;
    EXPECT_LT(RotationAngle(result.b_from_a.rotation, kTruth.rotation), 1e-13);
    EXPECT_LT(result.rms / unit, 1e-14);
  }
}

Rig RandomRig(Rng& rng, int count) {
  Rig rig;
  for (int i = 0; i < count; ++i) {
    RigCamera camera;
    camera.camera = MakePinhole("cam_" + std::to_string(i), 640, 480, 500 + 10 * i);
    camera.cam_from_world = {RotationExp(Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal())),
                             Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal())};
    rig.cameras.push_back(camera);
  }
  return rig;
}

TEST(CompareRigs, IsBlindToTheWorldFrameAndTheOrder) {
  Rng rng(6);
  for (const int count : {1, 2, 3, 8}) {
    const Rig reference = RandomRig(rng, count);
    Rig rig = reference;
    for (RigCamera& camera : rig.cameras) camera.cam_from_world = camera.cam_from_world * kTruth;
    std::reverse(rig.cameras.begin(), rig.cameras.end());
    const RigDifference difference = CompareRigs(rig, reference);
    ASSERT_EQ(difference.status, Status::kOk);
    EXPECT_LT(difference.max_rotation_rad, 1e-13) << count;
    EXPECT_LT(difference.max_translation_m, 1e-13 * 10) << count;
    EXPECT_EQ(difference.max_focal_relative, 0);
    EXPECT_LT(RotationAngle(difference.reference_from_rig.rotation, kTruth.rotation), 1e-13);
  }
}

TEST(CompareRigs, GivesTheSameNumbersInEveryFrame) {
  Rng rng(7);
  const Rig reference = RandomRig(rng, 6);
  Rig rig = reference;
  for (RigCamera& camera : rig.cameras) {
    Vector6d delta;
    for (int i = 0; i < 6; ++i) delta[i] = 1e-3 * rng.Normal();
    camera.cam_from_world = Perturb(delta, camera.cam_from_world);
  }
  rig.cameras[2].camera.params[1] *= 1.004;
  const RigDifference here = CompareRigs(rig, reference);
  for (RigCamera& camera : rig.cameras) camera.cam_from_world = camera.cam_from_world * kTruth;
  const RigDifference there = CompareRigs(rig, reference);
  EXPECT_NEAR(here.max_rotation_rad, there.max_rotation_rad, 1e-13);
  EXPECT_NEAR(here.mean_translation_m, there.mean_translation_m, 1e-13);
  EXPECT_NEAR(here.max_focal_relative, 0.004, 1e-12);
  EXPECT_GT(here.max_rotation_rad, here.mean_rotation_rad);
  EXPECT_GT(here.max_rotation_rad, 2e-4);
  EXPECT_LT(here.max_rotation_rad, 1e-2);
}

TEST(CompareRigs, FindsTheOneCameraThatMoved) {
  Rng rng(8);
  const Rig reference = RandomRig(rng, 40);
  Rig rig = reference;
  rig.cameras[5].cam_from_world.rotation = RotationExp({0.01, 0, 0}) * rig.cameras[5].cam_from_world.rotation;
  const RigDifference difference = CompareRigs(rig, reference);
  EXPECT_NEAR(difference.max_rotation_rad, 0.01, 1e-3);
  EXPECT_LT(difference.mean_rotation_rad, 1.5e-3);
}

TEST(CompareRigs, LensDifferenceIsThatOfTheSameRay) {
  Rng rng(10);
  const Rig reference = RandomRig(rng, 3);
  Rig rig = reference;
  EXPECT_LT(CompareRigs(rig, reference).max_lens_px, 1e-9);
  rig.cameras[1].camera.params[2] += 3;
  rig.cameras[1].camera.params[3] -= 4;
  EXPECT_NEAR(CompareRigs(rig, reference).max_lens_px, 5, 1e-9);
  // A k1 moves the corner of a pinhole by f k1 r^3.
  rig = reference;
  Camera& camera = rig.cameras[2].camera;
  camera.model = LensModel::kBrown1;
  camera.params = (Eigen::VectorXd(5) << camera.params, -0.01).finished();
  const double radius = std::hypot(camera.cx(), camera.cy()) / camera.fx();
  EXPECT_NEAR(CompareRigs(rig, reference).max_lens_px, 0.01 * camera.fx() * std::pow(radius, 3), 1e-9);
  camera.params[4] = -2;  // the corners lie beyond the fold
  EXPECT_TRUE(std::isinf(CompareRigs(rig, reference).max_lens_px));
}

TEST(CompareRigs, NeedsTheSameCameras) {
  Rng rng(9);
  const Rig reference = RandomRig(rng, 3);
  Rig rig = reference;
  rig.cameras[1].camera.name = "other";
  EXPECT_THROW(CompareRigs(rig, reference), ContractViolation);
  rig.cameras.pop_back();
  EXPECT_THROW(CompareRigs(rig, reference), ContractViolation);
  EXPECT_EQ(CompareRigs(Rig(), Rig()).status, Status::kTooFewViews);
}

}  // namespace
}  // namespace mvstudio::geometry
