#include "geometry/rig/rig_covariance.h"

#include "core/error.h"
#include "core/random.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

/// Cameras with pinhole lenses and a full joint covariance.
Rig MakeRig(int num_cameras, uint64_t seed = 1) {
  Rng rng(seed);
  Rig rig;
  const Eigen::Index n = 10 * num_cameras;
  Eigen::MatrixXd root(n, n);
  for (Eigen::Index i = 0; i < root.size(); ++i) root.data()[i] = 1e-2 * rng.Normal();
  rig.joint_covariance = root * root.transpose();
  for (int c = 0; c < num_cameras; ++c) {
    RigCamera camera;
    camera.camera = MakePinhole("cam" + std::to_string(c), 640, 480, 500);
    camera.cam_from_world.rotation = RotationExp(Eigen::Vector3d(0.1 * c, 0.3, -0.2 * c));
    camera.cam_from_world.translation = Eigen::Vector3d(c, 0.5, 2);
    camera.params_covariance = rig.joint_covariance->block<4, 4>(10 * c, 10 * c);
    camera.cam_from_world_covariance = rig.joint_covariance->block<6, 6>(10 * c + 4, 10 * c + 4);
    rig.cameras.push_back(camera);
  }
  return rig;
}

Rig ThroughFile(const Rig& rig) { return RigFromJsonText(RigToJsonText(rig), "file"); }

TEST(RigFile, TimeOffsetsAndShapesOfBoardsSurvive) {
  Rig rig = MakeRig(3);
  rig.cameras[1].time_offset = TimeOffset{-0.312345678901234, 0.0123};
  rig.boards.push_back({"charuco:7x5:35mm:26mm", {1e-4, -2e-4}, {3e-4, 1.2e-3}});
  const Rig read = ThroughFile(rig);
  EXPECT_FALSE(read.cameras[0].time_offset) << "not estimated is not zero";
  ASSERT_TRUE(read.cameras[1].time_offset);
  EXPECT_EQ(read.cameras[1].time_offset->frames, rig.cameras[1].time_offset->frames);
  EXPECT_EQ(read.cameras[1].time_offset->sigma_frames, 0.0123);
  ASSERT_EQ(read.boards.size(), 1u);
  EXPECT_EQ(read.boards[0].board, rig.boards[0].board);
  EXPECT_EQ(read.boards[0].bend_m, rig.boards[0].bend_m);
  EXPECT_EQ(read.boards[0].stretch, rig.boards[0].stretch);
  EXPECT_EQ(RigToJsonText(read), RigToJsonText(rig));
}

TEST(RigFile, WrongOffsetsAndShapesAreNamed) {
  Rig rig = MakeRig(1);
  rig.cameras[0].time_offset = TimeOffset{0.25, 0.5};
  rig.boards.push_back({"chessboard:9x6:60mm", {0, 0}, {0.25, 0.125}});
  const std::string text = RigToJsonText(rig);
  const auto refused = [&](const std::string& from, const std::string& to) -> std::string {
    std::string changed = text;
    changed.replace(changed.find(from), from.size(), to);
    try {
      RigFromJsonText(changed, "file");
    } catch (const FormatError& error) {
      return error.what();
    }
    return "read";
  };
  EXPECT_THAT(refused("\"frames\":0.25", "\"frames\":1e7"), HasSubstr("cameras[0].time_offset.frames"));
  EXPECT_THAT(refused("\"sigma_frames\":0.5", "\"sigma_frames\":-1"), HasSubstr("cameras[0].time_offset.sigma_frames"));
  EXPECT_THAT(refused("0.25,0.125", "0.25,0.6"), HasSubstr("boards[0].stretch"));
}

/// A camera without a block takes none from the others, nor their correlations.
TEST(StatedCovariance, OneMissingBlockLeavesTheOthers) {
  Rig rig = MakeRig(3);
  const Eigen::MatrixXd whole = *rig.joint_covariance;
  rig.cameras[1].cam_from_world_covariance.reset();
  for (const Rig& each : {rig, ThroughFile(rig)}) {
    EXPECT_TRUE(HasJointCovariance(each));
    EXPECT_THAT(CamerasWithoutCovariance(each), ElementsAre("cam1"));
    const StatedCovariance stated = StatedCovarianceOf(each);
    EXPECT_TRUE(stated.correlated);
    EXPECT_TRUE(stated.lens_known[1]);
    EXPECT_FALSE(stated.pose_known[1]);
    EXPECT_FALSE(stated.Knows(1));
    EXPECT_LT((stated.joint.topRightCorner(14, 10) - whole.topRightCorner(14, 10)).norm(), 1e-15);
    EXPECT_EQ((stated.joint.middleRows<6>(14).norm()), 0);
    EXPECT_EQ((stated.joint.middleCols<6>(14).norm()), 0);
  }
}

TEST(StatedCovariance, NothingIsKnownOfARigWithoutBlocks) {
  Rig rig = MakeRig(2);
  for (RigCamera& camera : rig.cameras) camera.params_covariance.reset(), camera.cam_from_world_covariance.reset();
  EXPECT_FALSE(HasJointCovariance(rig)) << "a joint covariance whose blocks nobody confirms is stale";
  EXPECT_FALSE(StatedCovarianceOf(rig).AnyKnown());
  EXPECT_EQ(RigToJsonText(rig).find("joint_covariance"), std::string::npos);
}

TEST(StatedCovariance, BlocksAloneCountAsIndependent) {
  Rig rig = MakeRig(2);
  rig.joint_covariance.reset();
  const StatedCovariance stated = StatedCovarianceOf(rig);
  EXPECT_FALSE(stated.correlated);
  EXPECT_EQ((stated.joint.block<4, 6>(0, 4).norm()), 0);
  EXPECT_EQ((stated.joint.block<6, 6>(14, 14)), *rig.cameras[1].cam_from_world_covariance);
  Rig stored = rig;
  StoreCovariance(stated, &stored);
  EXPECT_FALSE(stored.joint_covariance) << "what is not known to be correlated is not stated as uncorrelated";
}

TEST(StatedCovariance, FollowsOrderAndChoiceOfCameras) {
  const Rig rig = MakeRig(3);
  Rig rotated = rig;
  rotated.cameras = {rig.cameras[2], rig.cameras[0], rig.cameras[1]};  // camera i at place order[i]
  rotated.joint_covariance = ReorderedJointCovariance(rig, {1, 2, 0});
  EXPECT_TRUE(HasJointCovariance(rotated));
  const Rig subset = SubsetOf(rotated, {0, 2});
  ASSERT_TRUE(HasJointCovariance(subset));
  EXPECT_EQ((subset.joint_covariance->block<10, 10>(0, 10)), (rig.joint_covariance->block<10, 10>(20, 10)));
}

/// First order: the moved rig's perturbation is that of the given one, seen in the moved world.
TEST(MovedWorld, CarriesTheCovariance) {
  const Rig rig = MakeRig(2);
  const Eigen::Vector3d offset(30, -20, 5);
  const Rig moved = MovedWorld(rig, offset);
  const Eigen::Vector3d x(1, 2, 3);
  for (size_t c = 0; c < 2; ++c)
    EXPECT_LT((moved.cameras[c].cam_from_world * Eigen::Vector3d(x - offset) - rig.cameras[c].cam_from_world * x).norm(),
              1e-12);
  Eigen::MatrixXd by_given = Eigen::MatrixXd::Identity(20, 20);
  constexpr double kStep = 1e-6;
  for (int c = 0; c < 2; ++c) {
    for (int k = 0; k < 6; ++k) {
      Rig other = rig;
      other.joint_covariance.reset();
      other.cameras[c].cam_from_world = Perturb(Vector6d(kStep * Vector6d::Unit(k)), rig.cameras[c].cam_from_world);
      const Rigid3 a = MovedWorld(other, offset).cameras[c].cam_from_world, b = moved.cameras[c].cam_from_world;
      by_given.block<3, 1>(10 * c + 4, 10 * c + 4 + k) = RotationLog(a.rotation * b.rotation.conjugate()) / kStep;
      by_given.block<3, 1>(10 * c + 7, 10 * c + 4 + k) = (a.translation - b.translation) / kStep;
    }
  }
  const Eigen::MatrixXd expected = by_given * *rig.joint_covariance * by_given.transpose();
  ASSERT_TRUE(HasJointCovariance(moved));
  EXPECT_LT((*moved.joint_covariance - expected).norm(), 1e-4 * expected.norm());
  const Rig back = MovedWorld(moved, -offset);
  EXPECT_LT((*back.joint_covariance - *rig.joint_covariance).norm(), 1e-9 * expected.norm());
}

/// A similarity leaves every pixel where it was, and the covariance follows to first order.
TEST(InWorld, KeepsPixelsAndCarriesTheCovariance) {
  const Rig rig = MakeRig(2);
  constexpr double kScale = 1.7, kStep = 1e-6;
  const Rigid3 turn{RotationExp(Eigen::Vector3d(0.4, -1.1, 2)), Eigen::Vector3d(3, -2, 5)};
  const Rig moved = InWorld(rig, turn, kScale);
  for (const Eigen::Vector3d& x : {Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(-0.5, 0.1, 4)}) {
    const Eigen::Vector3d x_new = kScale * (turn.rotation * x) + turn.translation;
    for (size_t c = 0; c < 2; ++c) {
      const Projection before = Project(rig.cameras[c].camera, rig.cameras[c].cam_from_world * x);
      const Projection after = Project(moved.cameras[c].camera, moved.cameras[c].cam_from_world * x_new);
      ASSERT_EQ(before.status, after.status);
      EXPECT_LT((before.px - after.px).norm(), 1e-9);
    }
  }
  Eigen::MatrixXd by_given = Eigen::MatrixXd::Identity(20, 20);
  for (int c = 0; c < 2; ++c) {
    for (int k = 0; k < 6; ++k) {
      Rig other = rig;
      other.joint_covariance.reset();
      other.cameras[c].cam_from_world = Perturb(Vector6d(kStep * Vector6d::Unit(k)), rig.cameras[c].cam_from_world);
      const Rigid3 a = InWorld(other, turn, kScale).cameras[c].cam_from_world, b = moved.cameras[c].cam_from_world;
      by_given.block<3, 1>(10 * c + 4, 10 * c + 4 + k) = RotationLog(a.rotation * b.rotation.conjugate()) / kStep;
      by_given.block<3, 1>(10 * c + 7, 10 * c + 4 + k) = (a.translation - b.translation) / kStep;
    }
  }
  const Eigen::MatrixXd expected = by_given * *rig.joint_covariance * by_given.transpose();
  ASSERT_TRUE(HasJointCovariance(moved));
  EXPECT_LT((*moved.joint_covariance - expected).norm(), 1e-5 * expected.norm());
  EXPECT_THROW(InWorld(rig, turn, 0), ContractViolation);
}

TEST(JointCovariance, BeyondTheLimitIsLeftOutWithANote) {
  Rig rig;
  const int cameras = static_cast<int>(kMaxJointUnknowns / 10) + 1;
  for (int c = 0; c < cameras; ++c) {
    RigCamera camera;
    camera.camera = MakePinhole("cam" + std::to_string(c), 640, 480, 500);
    camera.params_covariance = Eigen::MatrixXd::Identity(4, 4);
    camera.cam_from_world_covariance = Eigen::Matrix<double, 6, 6>::Identity();
    rig.cameras.push_back(camera);
  }
  rig.joint_covariance = Eigen::MatrixXd::Identity(10 * cameras, 10 * cameras);
  EXPECT_THAT(WhyJointCovarianceLeftOut(rig), HasSubstr("3010 unknowns"));
  const std::string text = RigToJsonText(rig);
  EXPECT_THAT(text, HasSubstr("joint_covariance_left_out"));
  EXPECT_THAT(text, Not(HasSubstr("joint_covariance_lower")));
  const Rig read = RigFromJsonText(text, "file");
  EXPECT_TRUE(read.cameras.back().params_covariance) << "the cameras' own blocks remain";
  rig = SubsetOf(rig, {0, 1, 2});
  EXPECT_EQ(WhyJointCovarianceLeftOut(rig), "");
  EXPECT_THAT(RigToJsonText(rig), HasSubstr("joint_covariance_lower"));
}

}  // namespace
}  // namespace mvstudio::geometry
