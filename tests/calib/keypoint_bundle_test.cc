#include <Eigen/Eigenvalues>

#include "calib/keypoints/bundle.h"
#include "calib/keypoints/choice.h"
#include "calib/keypoints/split.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/keypoint_support.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

PeopleOptions Exact() {
  PeopleOptions options;
  options.noise_px = options.outlier_fraction = 0, options.num_frames = 12, options.num_joints = 8;
  return options;
}

TEST(KeypointBundle, RecoversFromABadStartExactly) {
  const geometry::Rig truth = PeopleRig(4);
  const auto joints = JointsOf(truth, FilmPeople(truth, Exact()));
  const geometry::Rig start = testing::Disturbed(truth, 0.05, 0.15, 3);
  EXPECT_GT(ErrorOf(FitKeypoints(start, joints, 0, 3, 1), {}).median_px, 20);
  const KeypointSolution solution = SolveKeypoints(start, joints, {}, 0, 1);
  ASSERT_EQ(solution.status, Status::kOk) << solution.message;
  const geometry::Rig found = AlignToGiven(solution.rig, truth);
  const geometry::RigDifference difference = geometry::CompareRigs(found, truth);
  EXPECT_LT(difference.max_rotation_rad, 1e-5);
  EXPECT_LT(difference.max_translation_m, 1e-4);
}

TEST(KeypointBundle, FocalLengthsToo) {
  const geometry::Rig truth = PeopleRig(4);
  const auto joints = JointsOf(truth, FilmPeople(truth, Exact()));
  geometry::Rig start = testing::Disturbed(truth, 0.02, 0.05, 4);
  start.cameras[1].camera.params.head<2>() *= 1.03, start.cameras[2].camera.params.head<2>() *= 0.98;
  KeypointPlan plan;
  plan.free_poses = plan.free_focal = true;
  const KeypointSolution solution = SolveKeypoints(start, joints, FreedomOf(start, plan), 0, 1);
  for (size_t c = 0; c < 4; ++c) EXPECT_NEAR(solution.rig.cameras[c].camera.fx() / truth.cameras[c].camera.fx(), 1, 1e-4) << c;
}

/// The cost would rather fit one of two views exactly. The scale of the noise must not shrink by that, round by round, until a
/// few points alone decide.
TEST(KeypointBundle, TheScaleOfTwoViewsIsThatOfTheNoise) {
  PeopleOptions options;
  options.num_frames = 60, options.num_joints = 6, options.noise_px = 1;
  for (const int cameras : {2, 5}) {
    const geometry::Rig truth = PeopleRig(cameras);
    const auto joints = JointsOf(truth, FilmPeople(truth, options));
    const KeypointSolution solution = SolveKeypoints(testing::Disturbed(truth, 0.01, 0.03, 7), joints, {}, 0, 1);
    ASSERT_EQ(solution.status, Status::kOk) << solution.message;
    EXPECT_GT(solution.cauchy_px, 0.5 * 0.68) << cameras;  // a normal variable's median length is sqrt(3) * 0.68
    EXPECT_LT(solution.cauchy_px, 1.5 * 0.68) << cameras;
    EXPECT_EQ(WhyUnsteady(solution.rig, CovarianceOfKeypoints(solution, joints, {}, 1)), "") << cameras;
  }
}

TEST(KeypointBundle, TooFewJointsAreSaidSo) {
  const geometry::Rig rig = PeopleRig(3);
  auto joints = JointsOf(rig, FilmPeople(rig, Exact()));
  joints.resize(5);
  const KeypointSolution solution = SolveKeypoints(rig, joints, {}, 0, 1);
  EXPECT_EQ(solution.status, Status::kTooFewViews);
  EXPECT_FALSE(solution.message.empty());
}

geometry::Rig Similar(const geometry::Rig& rig, double scale) {
  geometry::Rig moved = rig;
  const geometry::Rigid3 motion{geometry::RotationExp({0.3, -0.5, 0.9}), {3, -2, 1}};
  for (geometry::RigCamera& camera : moved.cameras) {
    const Eigen::Vector3d centre = motion * Eigen::Vector3d(scale * camera.CenterInWorld());
    camera.cam_from_world.rotation = camera.cam_from_world.rotation * motion.rotation.conjugate();
    camera.cam_from_world.translation = -(camera.cam_from_world.rotation * centre);
  }
  return moved;
}

TEST(KeypointBundle, AlignmentUndoesASimilarity) {
  for (const int cameras : {2, 3, 4, 7}) {
    const geometry::Rig rig = PeopleRig(cameras);
    const geometry::Rig back = AlignToGiven(Similar(rig, 1.7), rig);
    for (int c = 0; c < cameras; ++c) {
      EXPECT_LT((back.cameras[c].CenterInWorld() - rig.cameras[c].CenterInWorld()).norm(), 1e-12) << cameras;
      EXPECT_LT(geometry::RotationAngle(back.cameras[c].cam_from_world.rotation, rig.cameras[c].cam_from_world.rotation), 1e-7);
    }
  }
  EXPECT_FALSE(CentresHoldFrame(PeopleRig(2)));
  EXPECT_TRUE(CentresHoldFrame(PeopleRig(3)));
}

TEST(KeypointBundle, CovarianceHoldsTheGauge) {
  const geometry::Rig rig = PeopleRig(3);
  PeopleOptions options;
  options.num_frames = 20;
  const auto joints = JointsOf(rig, FilmPeople(rig, options));
  KeypointSolution solution = SolveKeypoints(rig, joints, {}, 0, 1);
  solution.rig = AlignToGiven(solution.rig, rig);
  const KeypointCovariance covariance = CovarianceOfKeypoints(solution, joints, {}, 1);
  ASSERT_EQ(covariance.status, Status::kOk) << covariance.message;
  ASSERT_EQ(covariance.joint.rows(), 3 * (6 + 6));
  // 18 numbers of three poses less the 7 of a similarity.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance.joint);
  EXPECT_EQ((eigen.eigenvalues().array() > 1e-9 * eigen.eigenvalues().maxCoeff()).count(), 11);
  // The mean of the centres does not move: its variance is zero.
  Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(3, 36);
  for (int c = 0; c < 3; ++c) {
    const geometry::Rigid3& pose = solution.rig.cameras[c].cam_from_world;
    constexpr double kStep = 1e-6;
    for (int k = 0; k < 6; ++k) {
      const geometry::Vector6d step = kStep * geometry::Vector6d::Unit(k);
      const Eigen::Vector3d plus = geometry::Inverse(geometry::Perturb(step, pose)).translation;
      const Eigen::Vector3d minus = geometry::Inverse(geometry::Perturb(-step, pose)).translation;
      mean.col(12 * c + 6 + k) = (plus - minus) / (2 * kStep) / 3;
    }
  }
  const double own = CentreCovariance(solution.rig.cameras[0].cam_from_world, covariance.joint.block<6, 6>(6, 6)).trace();
  EXPECT_LT((mean * covariance.joint * mean.transpose()).trace(), 1e-6 * own);
}

}  // namespace
}  // namespace mvstudio::calib
