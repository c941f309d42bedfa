#include <Eigen/Cholesky>

#include "calib/check/rig_check.h"
#include "geometry/rig/rig_covariance.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// The truth with camera 2 turned by 0.4 degrees, and a covariance of everything.
geometry::Rig MakeGiven(const testing::Scene& scene) {
  geometry::Rig rig = testing::TruthRig(scene);
  geometry::Vector6d bump;
  bump << 0.007, 0, 0, 0.004, 0, 0;
  rig.cameras[2].cam_from_world = geometry::Perturb(bump, rig.cameras[2].cam_from_world);
  geometry::StatedCovariance stated = geometry::StatedCovarianceOf(rig);
  Rng rng(4);
  const Eigen::Index n = stated.joint.rows(), p = rig.cameras[0].camera.params.size();
  Eigen::MatrixXd root(n, n);
  for (Eigen::Index i = 0; i < root.size(); ++i) root.data()[i] = 0.3 * rng.Normal();
  root.diagonal().array() += 1;
  Eigen::VectorXd sigma = Eigen::VectorXd::Constant(n, 6e-5);  // small enough not to count as motions
  for (size_t c = 0; c < rig.cameras.size(); ++c) sigma.segment(stated.begin[c], p).head<4>().setConstant(0.03);
  root = sigma.asDiagonal() * root;
  stated.joint = root * root.transpose(), stated.correlated = true;
  stated.lens_known.assign(rig.cameras.size(), true), stated.pose_known = stated.lens_known;
  geometry::StoreCovariance(stated, &rig);
  return rig;
}

void Shift(const Eigen::VectorXd& delta, geometry::Rig* rig) {
  Eigen::Index row = 0;
  for (geometry::RigCamera& camera : rig->cameras) {
    const Eigen::Index p = camera.camera.params.size();
    camera.camera.params += delta.segment(row, p);
    camera.cam_from_world = geometry::Perturb(geometry::Vector6d(delta.segment<6>(row + p)), camera.cam_from_world);
    row += p + 6;
  }
}

geometry::Vector6d Difference(const geometry::Rigid3& a, const geometry::Rigid3& b) {
  geometry::Vector6d d;
  d << geometry::RotationLog(a.rotation * b.rotation.conjugate()), a.translation - b.translation;
  return d;
}

testing::Scene MakeCheckScene(double noise_px) {
  testing::SceneOptions options;
  options.num_cameras = 4, options.num_frames = 12, options.noise_px = noise_px, options.seed = 3;
  return testing::MakeScene(options);
}

/// Monte Carlo: cameras that err by what the calibration states place the bumped one; its new covariance covers the truth,
/// which the boards' noise alone does not.
TEST(RepairCovariance, CoversTheTruth) {
  constexpr int kSamples = 25;
  testing::Scene scene = MakeCheckScene(0.05);
  const geometry::Rig given = MakeGiven(scene), truth = testing::TruthRig(scene);
  const Eigen::MatrixXd root = given.joint_covariance->llt().matrixL();
  double with = 0, without = 0;
  for (int sample = 0; sample < kSamples; ++sample) {
    Rng rng(30 + static_cast<uint64_t>(sample));
    Eigen::VectorXd delta(root.rows());
    for (Eigen::Index i = 0; i < delta.size(); ++i) delta[i] = rng.Normal();
    geometry::Rig rig = given;
    Shift(root * delta, &rig);
    testing::ObserveAll(&scene, 0.05, 100 + static_cast<uint64_t>(sample));
    const RigCheck check = CheckRig(rig, ToInput(scene), {}, {});
    ASSERT_THAT(check.moved, ElementsAre("cam2")) << sample;
    const geometry::RigCamera& repaired = check.repaired.cameras[2];
    ASSERT_TRUE(repaired.cam_from_world_covariance);
    ASSERT_TRUE(geometry::HasJointCovariance(check.repaired));
    const geometry::Vector6d error = Difference(repaired.cam_from_world, truth.cameras[2].cam_from_world);
    with += error.dot(repaired.cam_from_world_covariance->ldlt().solve(error)) / (6 * kSamples);
    geometry::Rig nothing = rig;
    for (geometry::RigCamera& camera : nothing.cameras)
      camera.params_covariance->setZero(), camera.cam_from_world_covariance->setZero();
    nothing.joint_covariance->setZero();
    const RigCheck exact = CheckRig(nothing, ToInput(scene), {}, {});
    without += error.dot(exact.repaired.cameras[2].cam_from_world_covariance->ldlt().solve(error)) / (6 * kSamples);
  }
  // The boards' own part is widened by what the cameras disagree, so the figure may lie below 1.
  EXPECT_LT(with, 1 + 3.5 * std::sqrt(2.0 / (6 * kSamples)));
  EXPECT_GT(with, 0.4);
  EXPECT_GT(without, 2 * with) << "an exact calibration would not cover it as well";
}

TEST(RepairCovariance, OthersKeepTheirsAndUnknownStaysUnknown) {
  const testing::Scene scene = MakeCheckScene(0.05);
  geometry::Rig given = MakeGiven(scene);
  const RigCheck whole = CheckRig(given, ToInput(scene), {}, {});
  ASSERT_THAT(whole.moved, ElementsAre("cam2"));
  EXPECT_EQ(*whole.repaired.cameras[1].cam_from_world_covariance, *given.cameras[1].cam_from_world_covariance);
  EXPECT_EQ(*whole.repaired.cameras[2].params_covariance, *given.cameras[2].params_covariance);
  const double sigma = whole.repaired.cameras[2].cam_from_world_covariance->trace();
  given.cameras[0].cam_from_world_covariance.reset();
  const RigCheck partial = CheckRig(given, ToInput(scene), {}, {});
  EXPECT_THAT(geometry::CamerasWithoutCovariance(partial.repaired), ElementsAre("cam0"));
  ASSERT_TRUE(partial.repaired.cameras[2].cam_from_world_covariance);
  EXPECT_LT(partial.repaired.cameras[2].cam_from_world_covariance->trace(), sigma) << "a lower bound";
  for (geometry::RigCamera& camera : given.cameras) camera.params_covariance.reset(), camera.cam_from_world_covariance.reset();
  const RigCheck none = CheckRig(given, ToInput(scene), {}, {});
  EXPECT_FALSE(none.repaired.cameras[2].cam_from_world_covariance) << "the noise of the boards is not all there is";
}

/// A board whose stretch the calibration states is seen in its own shape.
TEST(RepairCovariance, ABoardOfStatedShapeMovesNoCamera) {
  testing::Scene scene = MakeCheckScene(0);
  geometry::Rig rig = testing::TruthRig(scene);
  rig.boards.push_back({ToString(scene.board), {0, 0}, {0, 4e-3}});
  const RigCheck wrong = CheckRig(rig, ToInput(scene), {}, {});
  rig.boards.clear();
  const RigCheck right = CheckRig(rig, ToInput(scene), {}, {});
  EXPECT_LT(right.rms_px, 1e-3);
  EXPECT_GT(wrong.rms_px, 0.05) << "the shape is used";
}

}  // namespace
}  // namespace mvstudio::calib
