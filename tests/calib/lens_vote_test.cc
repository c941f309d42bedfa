#include "calib/keypoints/lens_vote.h"

#include "tests/calib/keypoint_support.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

struct VoteScene {
  geometry::Rig rig = PeopleRig(4);
  std::vector<KeypointJoint> joints;
  std::vector<KeypointFit> fits;

  explicit VoteScene(int num_joints) {
    PeopleOptions options;
    options.num_joints = num_joints, options.outlier_fraction = 0, options.noise_px = 0.3;
    joints = JointsOf(rig, FilmPeople(rig, options));
    fits = FitKeypoints(rig, joints, 1, 2, 1);
  }

  /// The same views, explained by points that `change` moved.
  template <class Change>
  LensVote After(const Change& change, double before_px, double after_px) const {
    std::vector<KeypointFit> after = fits;
    for (KeypointFit& fit : after) fit.x_in_world = change(fit.x_in_world);
    return VoteOnLenses(rig, fits, after, before_px, after_px, 1);
  }
};

Eigen::Vector3d Similar(const Eigen::Vector3d& x) {
  return 1.1 * (geometry::RotationExp({0.1, 0.2, 0}) * x) + Eigen::Vector3d(1, 2, 3);
}

Eigen::Vector3d Bent(const Eigen::Vector3d& x) { return (x.array() * Eigen::Array3d(1, 1, 1.03)).matrix(); }

TEST(LensVote, UnconnectedPoints) {
  const VoteScene scene(1);
  const LensVote similar = scene.After(Similar, 0.27, 0.04);
  EXPECT_LT(similar.bend_px, 1e-6);
  EXPECT_EQ(similar.num_distances, 0);
  EXPECT_EQ(similar.refusal, "");
  const LensVote bent = scene.After(Bent, 0.27, 0.04);
  EXPECT_GT(bent.bend_px, 3 * bent.gain_px);
  EXPECT_THAT(bent.refusal, ::testing::HasSubstr("the points do not determine it"));
  EXPECT_EQ(scene.After(Bent, 20, 0.3).refusal, "") << "errors of many pixels go away with it";
}

TEST(LensVote, DistancesThatStayDecide) {
  const VoteScene scene(6);
  const LensVote bent = scene.After(Bent, 20, 0.3);
  EXPECT_GT(bent.num_distances, 0);
  EXPECT_THAT(bent.refusal, ::testing::HasSubstr("distances that stay the same scatter"));
}

}  // namespace
}  // namespace mvstudio::calib
