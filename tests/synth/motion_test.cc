#include "synth/motion.h"

#include <Eigen/Geometry>
#include <cmath>

#include "tests/support/test.h"

namespace mvstudio::synth {
namespace {

const body::BodyTemplate& Mannequin() {
  static const body::BodyTemplate body = body::MakeMannequin(1.75, 0.6);
  return body;
}

TEST(PersonPose, StandsOnTheFloorInsideTheRoom) {
  for (uint64_t seed : {1u, 2u, 3u}) {
    for (int f = 0; f < 100; f += 3) {
      const Eigen::Matrix3Xf vertices = body::SkinVertices(Mannequin(), PersonPose(Mannequin(), f / 25.0, seed));
      EXPECT_NEAR(vertices.row(2).minCoeff(), 0, 1e-5);
      EXPECT_GT(vertices.row(2).maxCoeff(), 1.4);
      EXPECT_LT(vertices.row(2).maxCoeff(), 2.3);
      EXPECT_LT(vertices.topRows<2>().colwise().norm().maxCoeff(), 1.5);
    }
  }
}

TEST(PersonPose, MovesSmoothlyAndKneesBendBackwards) {
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25");
  const body::BodyTemplate& body = Mannequin();
  const int l_shin = 14;
  ASSERT_EQ(body.bone_names[l_shin], "l_shin");
  Eigen::Matrix3Xd before;
  for (int f = 0; f < 100; ++f) {
    const body::BodyPose pose = PersonPose(body, f / 25.0, 1);
    const Eigen::Matrix3Xd joints = PersonJoints(body, pose, skeleton);
    if (f > 0) {
      EXPECT_LT((joints - before).colwise().norm().maxCoeff() * 25, 6.0) << "m/s at frame " << f;
    }
    before = joints;
    const Eigen::Quaterniond knee =
        pose.bone_transforms[l_shin - 1].rotation.conjugate() * pose.bone_transforms[l_shin].rotation;
    const Eigen::Vector3d bend = geometry::RotationLog(knee);
    EXPECT_GE(bend[0], 0.05);
    EXPECT_LT(bend[0], 2.0);
  }
}

/// Joints relative to the pelvis, turned to face -y.
Eigen::Matrix3Xd Shape(double time_s) {
  const body::BodyPose pose = PersonPose(Mannequin(), time_s, 1);
  const geometry::Rigid3 body_from_world = geometry::Inverse(pose.bone_transforms[0]);
  Eigen::Matrix3Xd joints = body::PosedCoco19(Mannequin(), pose);
  for (int j = 0; j < 19; ++j) joints.col(j) = body_from_world * joints.col(j);
  return joints;
}

TEST(PersonPose, TheLastFramesShowPosesNotSeenBefore) {
  for (int held_out = 80; held_out < 100; ++held_out) {
    const Eigen::Matrix3Xd shape = Shape(held_out / 25.0);
    double nearest = 1e9;
    for (int f = 0; f < 76; ++f) nearest = std::min(nearest, (Shape(f / 25.0) - shape).colwise().norm().maxCoeff());
    EXPECT_GT(nearest, 0.05) << "frame " << held_out;
  }
}

TEST(PersonJoints, FeetFollowTheAnkles) {
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25");
  for (int f = 0; f < 50; ++f) {
    const Eigen::Matrix3Xd joints = PersonJoints(Mannequin(), PersonPose(Mannequin(), 0.37 * f, 4), skeleton);
    for (const char* side : {"L", "R"}) {
      const Eigen::Vector3d ankle = joints.col(skeleton.Find(std::string(side) + "Ankle"));
      const Eigen::Vector3d toe = joints.col(skeleton.Find(std::string(side) + "BigToe"));
      const Eigen::Vector3d heel = joints.col(skeleton.Find(std::string(side) + "Heel"));
      EXPECT_NEAR((toe - ankle).norm(), 0.19, 0.02);
      EXPECT_NEAR((heel - toe).norm(), 0.22, 0.01);
    }
  }
}

/// Joints that synth gave before bodies other than the mannequin could walk, by seed 1 at 0.36 s.
TEST(PersonPose, OfTheMannequinIsWhatItAlwaysWas) {
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25");
  const body::BodyTemplate body = body::MakeMannequin();
  const Eigen::Matrix3Xd joints = PersonJoints(body, PersonPose(body, 9 / 25.0, 1), skeleton);
  const std::pair<const char*, Eigen::Vector3d> known[] = {
      {"Nose", {0.2212846490188977, -0.0008280541672157221, 1.5447091550798342}},
      {"RWrist", {-0.004569147899690207, -0.37507968483816084, 1.0755303547060173}},
      {"LWrist", {0.6594872538478459, 0.09258344363801141, 1.0606395554868744}},
      {"RAnkle", {-0.10266763733339354, 0.38575109254389145, 0.1984144721005765}},
      {"LBigToe", {0.4927726912666185, -0.22733412178715276, 0.02981378191534751}},
      {"RHeel", {-0.1209686381565579, 0.43407648544209576, 0.16373407749346852}}};
  for (const auto& [name, expected] : known) EXPECT_LT((joints.col(skeleton.Find(name)) - expected).norm(), 1e-14) << name;
}

TEST(TurnPose, GoesOnceAroundOnTheSpotInAPose) {
  const body::BodyTemplate& body = Mannequin();
  double total = 0, before = 0;
  for (int f = 0; f <= 100; ++f) {
    const body::BodyPose pose = TurnPose(body, 0.1 * f, 10, 3);
    const Eigen::Matrix3Xf vertices = body::SkinVertices(body, pose);
    EXPECT_NEAR(vertices.row(2).minCoeff(), 0, 1e-5);
    const Eigen::Vector3d forward = pose.bone_transforms[0].rotation * -Eigen::Vector3d::UnitY();
    const double heading = std::atan2(forward[0], -forward[1]);
    if (f > 0) total += std::remainder(heading - before, 6.283185307179586);
    before = heading;
    const Eigen::Matrix3Xd joints = body::PosedCoco19(body, pose);
    EXPECT_LT(joints.col(2).head<2>().norm(), 0.05);
    for (const int shoulder : {3, 9}) {
      const Eigen::Vector3d arm = (joints.col(shoulder + 1) - joints.col(shoulder)).normalized();
      EXPECT_NEAR(std::acos(-arm[2]), 0.785, 0.16) << "frame " << f;
    }
  }
  EXPECT_NEAR(total, 6.283, 0.1);
}

/// Bodies with their arms at other angles hang them alike.
TEST(TurnPose, OfATPoseHasArmsAtHalfARightAngle) {
  body::BodyTemplate body = Mannequin();
  for (const int bone : {6, 7, 8, 10, 11, 12}) {  // arms raised to the sides, hands at the height of the shoulders
    for (Eigen::Matrix3Xd* points : {&body.bone_heads, &body.bone_tails}) {
      const double sign = bone < 9 ? 1 : -1;
      const Eigen::Vector3d shoulder(sign * 0.172, 0.01, 1.395);
      points->col(bone) =
          shoulder + Eigen::AngleAxisd(-sign * 0.7853981633974483, Eigen::Vector3d::UnitY()) * (points->col(bone) - shoulder);
    }
  }
  const body::BodyPose pose = TurnPose(body, 0, 10, 3);
  for (const int bone : {6, 10}) {
    const Eigen::Vector3d arm = pose.bone_transforms[bone].rotation * (body.bone_tails.col(bone) - body.bone_heads.col(bone));
    EXPECT_NEAR(std::acos(-arm.normalized()[2]), 0.785, 0.16);
  }
}

TEST(BoardPose, StartsFlatOnTheFloorPrintedSideUp) {
  const calib::Board board = calib::ParseBoard("charuco:7x5:140mm:105mm");
  const geometry::Rigid3 pose = BoardPose(board, 0, 60, 1);
  const Eigen::Matrix3Xd corners = calib::CornersInBoard(board);
  for (int i = 0; i < corners.cols(); ++i) EXPECT_NEAR((pose * Eigen::Vector3d(corners.col(i)))[2], 0, 1e-12);
  EXPECT_LT((pose.rotation * Eigen::Vector3d::UnitZ() + Eigen::Vector3d::UnitZ()).norm(), 1e-12);  // away from the printed side
}

TEST(BoardPose, FacesAllDirectionsInsideTheVolume) {
  const calib::Board board = calib::ParseBoard("charuco:7x5:140mm:105mm");
  std::array<int, 8> octants{};
  for (int f = 1; f < 60; ++f) {
    const geometry::Rigid3 pose = BoardPose(board, f, 60, 1);
    const Eigen::Vector3d normal = pose.rotation * -Eigen::Vector3d::UnitZ();
    ++octants[static_cast<int>((std::atan2(normal[1], normal[0]) + 3.14159265) / 6.2831854 * 8) % 8];
    const Eigen::Matrix3Xd corners = calib::CornersInBoard(board);
    for (int i = 0; i < corners.cols(); ++i) {
      const Eigen::Vector3d x = pose * Eigen::Vector3d(corners.col(i));
      EXPECT_GT(x[2], 0.02) << "frame " << f;
      EXPECT_LT(x.head<2>().norm(), 1.6) << "frame " << f;
    }
  }
  for (int count : octants) EXPECT_GT(count, 2);
}

}  // namespace
}  // namespace mvstudio::synth
