#include "calib/keypoints/fit.h"
#include "tests/calib/keypoint_support.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

KeypointJoint See(const geometry::Rig& rig, const Eigen::Vector3d& x, int frame = 0, int joint_idx = 0) {
  KeypointJoint joint{frame, 0, joint_idx, {}};
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    triangulate::Observation seen;
    seen.camera_idx = static_cast<int>(c);
    seen.px = geometry::Project(rig.cameras[c].camera, rig.cameras[c].cam_from_world * x).px;
    joint.seen.push_back(seen);
  }
  return joint;
}

TEST(KeypointFit, PointIsExactWithoutNoise) {
  const geometry::Rig rig = PeopleRig(4);
  const Eigen::Vector3d x(0.3, -0.2, 0.5);
  for (const double cauchy_px : {0.0, 2.0}) {
    const auto fits = FitKeypoints(rig, {See(rig, x)}, cauchy_px, 2, 1);
    ASSERT_TRUE(fits[0].ok);
    EXPECT_LT((fits[0].x_in_world - x).norm(), 1e-7);
  }
}

/// One view of four that is 200 px off moves the Cauchy point by little and the least-squares point by much.
TEST(KeypointFit, AGrossErrorDoesNotPullThePoint) {
  const geometry::Rig rig = PeopleRig(4);
  const Eigen::Vector3d x(0.3, -0.2, 0.5);
  for (size_t wrong = 0; wrong < 4; ++wrong) {
    KeypointJoint joint = See(rig, x);
    joint.seen[wrong].px += Eigen::Vector2d(150, -130);
    EXPECT_LT((FitKeypoints(rig, {joint}, 2, 2, 1)[0].x_in_world - x).norm(), 2e-3);
    EXPECT_GT((FitKeypoints(rig, {joint}, 0, 2, 1)[0].x_in_world - x).norm(), 5e-2);
  }
}

TEST(KeypointFit, TooFewViewsAreLeftOut) {
  const geometry::Rig rig = PeopleRig(4);
  KeypointJoint two = See(rig, {0, 0, 0}), three = two;
  two.seen.resize(2), three.seen.resize(3);
  EXPECT_EQ(FitKeypoints(rig, {two, three}, 2, 3, 1).size(), 1u);
  EXPECT_EQ(FitKeypoints(rig, {two, three}, 2, 2, 1).size(), 2u);
}

TEST(KeypointFit, ErrorIsThatOfResidualsAndLimbs) {
  const KeypointJoint joint_a{0, 0, 0, std::vector<triangulate::Observation>(3)}, joint_b{0, 0, 1, joint_a.seen};
  const KeypointJoint later_a{1, 0, 0, joint_a.seen}, later_b{1, 0, 1, joint_a.seen};
  std::vector<KeypointFit> fits(5);
  fits[0] = {&joint_a, true, {0, 0, 0}, {{3, 4}, {0, 1}, {0, 2}}, 0};
  fits[1] = {&joint_b, true, {0, 0, 0.30}, {{0, 3}, {0, 4}, {0, 9}}, 0};
  fits[2] = {&later_a, true, {1, 0, 0}, {}, 0};
  fits[3] = {&later_b, true, {1, 0, 0.34}, {}, 0};
  fits[4] = {&later_b, false, {9, 9, 9}, {{1e9, 0}}, 0};
  const KeypointError error = ErrorOf(fits, {{0, 1}});
  EXPECT_DOUBLE_EQ(error.median_px, 3.5);  // of 1 2 3 4 5 9
  EXPECT_DOUBLE_EQ(error.mean_px, 4);
  EXPECT_NEAR(error.limb_mean_mm, 320, 1e-9);
  EXPECT_NEAR(error.limb_std_mm, 20, 1e-9);
  EXPECT_EQ(error.num_joints, 4);
  EXPECT_EQ(error.num_failed, 1);
}

/// The scale of a bivariate Cauchy variable, drawn as a normal one over a normal number.
TEST(KeypointFit, ScaleOfTheNoiseIsFound) {
  Rng rng(4);
  const KeypointJoint joint{0, 0, 0, std::vector<triangulate::Observation>(500000)};
  KeypointFit fit{&joint, true, {}, {}, 0};
  for (size_t i = 0; i < joint.seen.size(); ++i) {
    const double over = std::abs(rng.Normal());
    fit.residuals_px.push_back(2.5 * Eigen::Vector2d(rng.Normal(), rng.Normal()) / over);
  }
  EXPECT_NEAR(CauchyScale({fit}), 2.5, 0.02);
}

TEST(KeypointFit, ThreadsDoNotMatter) {
  const geometry::Rig rig = PeopleRig(4);
  const auto joints = testing::JointsOf(rig, FilmPeople(rig, {}));
  const auto one = FitKeypoints(rig, joints, 2, 2, 1), two = FitKeypoints(rig, joints, 2, 2, 2);
  ASSERT_EQ(one.size(), two.size());
  for (size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].x_in_world, two[i].x_in_world);
}

TEST(KeypointTake, FramesAreChosenAndThinned) {
  const FrameChoice choice{2, 4};
  EXPECT_TRUE(choice.Contains(2) && choice.Contains(6));
  EXPECT_FALSE(choice.Contains(0) || choice.Contains(4) || choice.Contains(-2));
  const geometry::Rig rig = PeopleRig(2);
  const auto joints = testing::JointsOf(rig, FilmPeople(rig, {}));
  EXPECT_EQ(FramesOf(JointsIn(joints, choice)), (std::vector<int>{2, 6, 10, 14, 18, 22, 26, 30, 34, 38}));
  EXPECT_EQ(FramesOf(Thinned(joints, 4)), (std::vector<int>{0, 10, 20, 30}));
  EXPECT_EQ(FramesOf(Thinned(joints, 100)).size(), 40u);
}

}  // namespace
}  // namespace mvstudio::calib
