#include "calib/keypoints/lens_conflict.h"

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Focal length and radial term of one camera: the calibration knows each by itself to 1, together far better.
struct Stated {
  geometry::Rig rig;
  KeypointFreedom freedom;
  LensConflict conflict;
};

Stated TwoTerms(double correlation, double found_sigma) {
  Stated stated;
  geometry::RigCamera camera;
  camera.camera = testing::MakeCamera("cam0", geometry::LensModel::kBrown1, 900);
  Eigen::MatrixXd known = Eigen::MatrixXd::Identity(5, 5);
  known(0, 4) = known(4, 0) = correlation;
  camera.params_covariance = known;
  stated.rig.cameras = {camera};
  Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(5, 2);
  directions(0, 0) = 3, directions(4, 1) = 1;
  stated.freedom.lens_directions = {directions};
  stated.conflict.solved = true;
  stated.conflict.lens = {found_sigma * found_sigma * Eigen::MatrixXd::Identity(5, 5)};
  return stated;
}

std::string Why(const Stated& stated) { return WhyNotDetermined(stated.conflict, 1, 1, stated.rig, stated.freedom); }

TEST(LensConflict, WhatIsKnownTogetherCountsTogether) {
  EXPECT_EQ(Why(TwoTerms(0, 0.5)), "") << "better than each by itself";
  const std::string together = Why(TwoTerms(0.98, 0.5));  // 1.41 along the sum, 0.14 along the difference
  EXPECT_NE(together.find("1.9 times those it states"), std::string::npos) << together;
  EXPECT_NE(Why(TwoTerms(0, 2)).find("2.0 times"), std::string::npos);
  Stated exact = TwoTerms(0, 0.5);
  exact.rig.cameras[0].params_covariance->setZero();
  EXPECT_EQ(Why(exact), "") << "nothing is stated";
}

}  // namespace
}  // namespace mvstudio::calib
