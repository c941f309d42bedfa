#include "synth/cloth/muscles.h"

#include <Eigen/Geometry>
#include <cmath>

#include "avatar/body/role_bones.h"
#include "tests/support/test.h"

namespace mvstudio::synth {
namespace {

const body::BodyTemplate& Mannequin() {
  static const body::BodyTemplate body = body::MakeMannequin(1.75, 0.7);
  return body;
}

/// All elbows and knees bent by `angle`, rad, anywhere in the world.
body::BodyPose Bent(double angle) {
  const body::RoleBones bones = body::FindRoleBones(Mannequin());
  std::vector<Eigen::Quaterniond> turns(Mannequin().bone_names.size(), Eigen::Quaterniond::Identity());
  for (int side = 0; side < 2; ++side) {
    const Eigen::Vector3d elbow = Eigen::Vector3d(-1, 0, side == 0 ? -1 : 1).normalized();
    turns[bones.arms[side][2]] = Eigen::AngleAxisd(angle, elbow);
    turns[bones.legs[side][1]] = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX());
  }
  return body::PoseFromAngles(Mannequin(), {geometry::RotationExp({0.4, -1, 2}), {3, -2, 1}}, turns);
}

/// m^3 of the closed surface.
double Volume(const Eigen::Matrix3Xf& vertices) {
  double volume = 0;
  for (Eigen::Index f = 0; f < Mannequin().faces.cols(); ++f) {
    Eigen::Matrix3d x;
    for (int k = 0; k < 3; ++k) x.col(k) = vertices.col(Mannequin().faces(k, f)).cast<double>();
    volume += x.determinant() / 6;
  }
  return volume;
}

TEST(Muscles, NothingSwellsAtRest) { EXPECT_TRUE(Muscles(Mannequin()).Swelling(Bent(0)).isZero(0)); }

TEST(Muscles, OtherJointsMoveNothing) {
  std::vector<Eigen::Quaterniond> turns(Mannequin().bone_names.size(), Eigen::Quaterniond::Identity());
  const body::RoleBones bones = body::FindRoleBones(Mannequin());
  turns[bones.head] = turns[bones.arms[0][1]] = turns[bones.legs[1][0]] = Eigen::AngleAxisd(0.8, Eigen::Vector3d::UnitX());
  EXPECT_LT(Muscles(Mannequin()).Swelling(body::PoseFromAngles(Mannequin(), {}, turns)).cwiseAbs().maxCoeff(), 1e-6f);
}

TEST(Muscles, VolumeGrowsWithTheAngle) {
  const Muscles muscles(Mannequin());
  double before = Volume(Mannequin().vertices);
  for (double angle = 0.2; angle < 2.6; angle += 0.2) {
    const double volume = Volume(Mannequin().vertices + muscles.Swelling(Bent(angle)));
    EXPECT_GT(volume, before + 1e-7) << angle << " rad";
    before = volume;
  }
}

TEST(Muscles, SwellAsOneMinusTheCosine) {
  const Muscles muscles(Mannequin());
  const Eigen::Matrix3Xf right_angle = muscles.Swelling(Bent(std::acos(0.0)));
  EXPECT_GT(right_angle.colwise().norm().maxCoeff(), 0.008f);
  EXPECT_LT(right_angle.colwise().norm().maxCoeff(), 0.020f);
  for (const double angle : {0.01, 0.7, 2.2}) {
    const Eigen::Matrix3Xf expected = static_cast<float>(1 - std::cos(angle)) * right_angle;
    EXPECT_LT((muscles.Swelling(Bent(angle)) - expected).cwiseAbs().maxCoeff(), 1e-7f) << angle << " rad";
  }
}

}  // namespace
}  // namespace mvstudio::synth
