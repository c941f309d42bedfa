#include "app/input/calib_read.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "core/units.h"
#include "tests/support/message_of.h"

namespace mvstudio::app {
namespace {

using mvstudio::testing::MessageOf;
using ::testing::HasSubstr;

TEST(CalibRead, FieldOfViewOfAPinhole) {
  const geometry::Camera centred = geometry::MakePinhole("a", 640, 480, 500);
  const Eigen::Vector3d fov = FieldOfViewDeg(centred);
  EXPECT_NEAR(fov[0], RadToDeg(2 * std::atan(320.0 / 500)), 1e-9);
  EXPECT_NEAR(fov[1], RadToDeg(2 * std::atan(240.0 / 500)), 1e-9);
  EXPECT_NEAR(fov[2], RadToDeg(2 * std::atan(400.0 / 500)), 1e-9);
  geometry::Camera shifted = centred;
  shifted.params[2] += 100;
  EXPECT_NEAR(FieldOfViewDeg(shifted)[0], RadToDeg(std::atan(420.0 / 500) + std::atan(220.0 / 500)), 1e-9);
}

TEST(CalibRead, SigmasAreThoseOfTheCovariance) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("a", 640, 480, 500);
  const CameraSigmas unknown = SigmasOf(camera);
  EXPECT_TRUE(std::isnan(unknown.focal_px) && std::isnan(unknown.rotation_rad) && std::isnan(unknown.position_m));
  Rng rng(5);
  for (int trial = 0; trial < 10; ++trial) {
    geometry::Vector6d pose;
    Eigen::Matrix<double, 6, 6> root;
    for (int i = 0; i < 6; ++i) pose[i] = rng.Normal();
    for (int i = 0; i < 36; ++i) root.data()[i] = rng.Normal();
    camera.cam_from_world = {geometry::RotationExp(pose.head<3>()), pose.tail<3>()};
    const Eigen::Matrix<double, 6, 6> covariance = root * root.transpose();
    camera.cam_from_world_covariance = covariance;
    camera.params_covariance = Eigen::Vector4d(4, 9, 100, 100).asDiagonal().toDenseMatrix();
    // How the centre moves when the pose is perturbed, by central differences.
    constexpr double kStep = 1e-5;
    Eigen::Matrix<double, 3, 6> centre_by_pose;
    for (int k = 0; k < 6; ++k) {
      const geometry::Vector6d delta = kStep * geometry::Vector6d::Unit(k);
      const auto centre = [&](const geometry::Vector6d& d) {
        return geometry::Inverse(geometry::Perturb(d, camera.cam_from_world)).translation;
      };
      centre_by_pose.col(k) = (centre(delta) - centre(-delta)) / (2 * kStep);
    }
    const auto largest = [](const Eigen::Matrix3d& m) {
      return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m).eigenvalues()[2]);
    };
    const CameraSigmas sigmas = SigmasOf(camera);
    EXPECT_EQ(sigmas.focal_px, 3);
    EXPECT_NEAR(sigmas.rotation_rad, largest(covariance.topLeftCorner<3, 3>()), 1e-9);
    EXPECT_NEAR(sigmas.position_m, largest(centre_by_pose * covariance * centre_by_pose.transpose()), 1e-6);
  }
}

TEST(CalibRead, SizesThatAreNoneAreRefused) {
  for (const std::string size : {"640", "640x", "x480", "0x480", "640x-480", "640x480px", "640x480x3"}) {
    ImageSize read;
    EXPECT_THAT(MessageOf<UsageError>([&] { FromString(size, &read); }), HasSubstr("option 'size' " + size));
  }
  CalibReadOptions panoptic;
  panoptic.from = calib::CalibrationFormat::kPanoptic;
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadCalibrationFiles({"a.json", "b.json"}, panoptic); }), HasSubstr("b.json"));
  EXPECT_THAT(MessageOf<IoError>([] { ReadCalibrationFiles({"/nowhere/c.json"}, {}); }), HasSubstr("/nowhere/c.json"));
}

}  // namespace
}  // namespace mvstudio::app
