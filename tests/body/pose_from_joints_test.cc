#include <Eigen/Geometry>
#include <limits>

#include "avatar/body/body_template.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

const BodyTemplate& Mannequin() {
  static const BodyTemplate body = MakeMannequin(1.75, 0.6);
  return body;
}

std::array<bool, 19> All() {
  std::array<bool, 19> valid;
  valid.fill(true);
  return valid;
}

BodyPose RandomPose(const BodyTemplate& body, Rng& rng) {
  std::vector<Eigen::Quaterniond> turns(body.bone_names.size());
  for (auto& q : turns) {
    const Eigen::Vector3d w = 0.35 * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
    q = geometry::RotationExp(w);
  }
  const Eigen::Vector3d root(3 * rng.Normal(), 3 * rng.Normal(), 3 * rng.Normal());
  return PoseFromAngles(body, {geometry::RotationExp(root), Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal())}, turns);
}

TEST(PoseFromAngles, IdentityKeepsTheRestPose) {
  const BodyTemplate& body = Mannequin();
  const BodyPose pose =
      PoseFromAngles(body, {}, std::vector<Eigen::Quaterniond>(body.bone_names.size(), Eigen::Quaterniond::Identity()));
  EXPECT_LT((SkinVertices(body, pose) - body.vertices).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((PosedCoco19(body, pose) - body.coco19).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(PoseFromAngles, ChildrenFollowTheirParents) {
  const BodyTemplate& body = Mannequin();
  std::vector<Eigen::Quaterniond> turns(body.bone_names.size(), Eigen::Quaterniond::Identity());
  turns[6] = geometry::RotationExp({0, 0, -0.5});  // left upper arm
  const Eigen::Matrix3Xd joints = PosedCoco19(body, PoseFromAngles(body, {}, turns));
  const Eigen::Vector3d shoulder = body.coco19.col(3);
  EXPECT_LT((joints.col(3) - shoulder).norm(), 1e-12);
  for (int j : {4, 5}) EXPECT_LT((joints.col(j) - (shoulder + turns[6] * (body.coco19.col(j) - shoulder))).norm(), 1e-12);
  for (int j : {0, 1, 2, 6, 9, 11, 14, 18}) EXPECT_LT((joints.col(j) - body.coco19.col(j)).norm(), 1e-12);
}

TEST(PoseFromJoints, MeetsTheJointsOfRandomPosesOfItsOwnBody) {
  const BodyTemplate& body = Mannequin();
  Rng rng(7);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Matrix3Xd truth = PosedCoco19(body, RandomPose(body, rng));
    BodyPose pose;
    ASSERT_TRUE(PoseFromJoints(body, truth, All(), &pose));
    EXPECT_LT((PosedCoco19(body, pose) - truth).colwise().norm().maxCoeff(), 1e-6) << "trial " << trial;
    EXPECT_NEAR(pose.girth, 1, 1e-9);
    EXPECT_TRUE(SkinVertices(body, pose).allFinite());
  }
}

TEST(PoseFromJoints, MeetsTheJointsOfAnotherBody) {
  const BodyTemplate& body = Mannequin();
  Rng rng(8);
  for (int trial = 0; trial < 50; ++trial) {
    Eigen::Matrix3Xd joints = 0.7 * PosedCoco19(body, RandomPose(body, rng));
    for (int j = 0; j < 19; ++j) joints.col(j) += 0.01 * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
    BodyPose pose;
    ASSERT_TRUE(PoseFromJoints(body, joints, All(), &pose));
    const Eigen::VectorXd error = (PosedCoco19(body, pose) - joints).colwise().norm();
    for (int j : {0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14}) EXPECT_LT(error[j], 1e-6) << "joint " << j;
    for (int j : {1, 15, 16, 17, 18}) EXPECT_LT(error[j], 0.06) << "joint " << j;
    EXPECT_NEAR(pose.girth, 0.7, 0.06);
  }
}

TEST(PoseFromJoints, RigidMotionOfTheJointsMovesTheBodyAlong) {
  const BodyTemplate& body = Mannequin();
  Rng rng(9);
  const Eigen::Matrix3Xd joints = PosedCoco19(body, RandomPose(body, rng));
  const geometry::Rigid3 b_from_a{geometry::RotationExp({0.3, -2, 1}), {1, 2, 3}};
  Eigen::Matrix3Xd moved = joints;
  for (int j = 0; j < 19; ++j) moved.col(j) = b_from_a * joints.col(j);
  BodyPose pose_a, pose_b;
  ASSERT_TRUE(PoseFromJoints(body, joints, All(), &pose_a));
  ASSERT_TRUE(PoseFromJoints(body, moved, All(), &pose_b));
  const Eigen::Matrix3Xf a = SkinVertices(body, pose_a), b = SkinVertices(body, pose_b);
  for (int i = 0; i < a.cols(); i += 17) EXPECT_LT((b_from_a * a.col(i).cast<double>() - b.col(i).cast<double>()).norm(), 1e-5);
}

TEST(PoseFromJoints, FillsMissingLimbsAndFaceFromTheRest) {
  const BodyTemplate& body = Mannequin();
  Rng rng(10);
  const Eigen::Matrix3Xd truth = PosedCoco19(body, RandomPose(body, rng));
  for (int missing = 0; missing < 19; ++missing) {
    auto valid = All();
    valid[missing] = false;
    Eigen::Matrix3Xd joints = truth;
    joints.col(missing).setConstant(std::numeric_limits<double>::quiet_NaN());
    BodyPose pose;
    ASSERT_TRUE(PoseFromJoints(body, joints, valid, &pose)) << "without joint " << missing;
    EXPECT_TRUE(SkinVertices(body, pose).allFinite());
    const Eigen::VectorXd error = (PosedCoco19(body, pose) - truth).colwise().norm();
    for (int j = 0; j < 15; ++j) {
      if (j != missing && j != 1) {
        EXPECT_LT(error[j], 1e-6) << "joint " << j << " without joint " << missing;
      }
    }
    EXPECT_LT(error[missing], 0.35) << "filled joint " << missing;
  }
}

TEST(PoseFromJoints, RefusesWhatFixesNoTrunk) {
  const BodyTemplate& body = Mannequin();
  BodyPose pose;
  Eigen::Matrix3Xd joints = body.coco19;
  joints(1, 4) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(PoseFromJoints(body, joints, All(), &pose));
  auto valid = All();
  valid[2] = valid[6] = false;  // body centre and one hip
  EXPECT_FALSE(PoseFromJoints(body, body.coco19, valid, &pose));
  valid = All();
  for (int j : {3, 9, 6, 12}) valid[j] = false;  // no side left
  EXPECT_FALSE(PoseFromJoints(body, body.coco19, valid, &pose));
  EXPECT_FALSE(PoseFromJoints(body, Eigen::Matrix3Xd::Zero(3, 19), All(), &pose));
  std::array<bool, 19> none{};
  EXPECT_FALSE(PoseFromJoints(body, body.coco19, none, &pose));
}

TEST(SkinVertices, StretchMovesTheFarEndOnly) {
  const BodyTemplate& body = Mannequin();
  Eigen::Matrix3Xd joints = body.coco19;
  const Eigen::Vector3d longer = 0.1 * (body.coco19.col(8) - body.coco19.col(7)).normalized();
  joints.col(8) += longer;  // left ankle
  BodyPose pose;
  ASSERT_TRUE(PoseFromJoints(body, joints, All(), &pose));
  const Eigen::Matrix3Xf vertices = SkinVertices(body, pose);
  for (int i = 0; i < vertices.cols(); ++i) {
    const Eigen::Vector3f moved = vertices.col(i) - body.vertices.col(i);
    if (body.vertices(2, i) > 0.65) {
      EXPECT_LT(moved.norm(), 1e-4);
    } else if (body.vertices(2, i) < 0.05 && body.vertices(0, i) > 0) {
      EXPECT_LT((moved.cast<double>() - longer).norm(), 0.02);
    }
  }
}

}  // namespace
}  // namespace mvstudio::body
