#include "stages/input/calib_read.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "core/random.h"
#include "core/units.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::stages {
namespace {

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

bool Warns(const calib::ImportedRig& imported, const std::string& code) {
  return std::any_of(imported.notes.begin(), imported.notes.end(), [&](const auto& note) { return note.code == code; });
}

/// Inputs that were reported: poses the wrong way round, and the same cameras with the right ones.
TEST(CalibRead, InvertedPosesAreRecognisedAndMended) {
  const std::string folder = mvstudio::testing::DataRoot() + "/reports/data/D-inverted";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is missing";
  const calib::ImportedRig right = ReadCalibrationFiles({folder + "/transforms_right.json"}, {});
  EXPECT_FALSE(Warns(right, "CAL-INVERTED"));
  EXPECT_TRUE(Warns(ReadCalibrationFiles({folder + "/transforms_inverted.json"}, {}), "CAL-INVERTED"));
  CalibReadOptions options;
  options.invert = true;
  const calib::ImportedRig mended = ReadCalibrationFiles({folder + "/transforms_inverted.json"}, options);
  EXPECT_FALSE(Warns(mended, "CAL-INVERTED"));
  ASSERT_EQ(mended.rig.cameras.size(), right.rig.cameras.size());
  for (size_t i = 0; i < right.rig.cameras.size(); ++i) {
    EXPECT_LT((mended.rig.cameras[i].CenterInWorld() - right.rig.cameras[i].CenterInWorld()).norm(), 1e-9);
    EXPECT_LT(mended.rig.cameras[i].cam_from_world.rotation.angularDistance(right.rig.cameras[i].cam_from_world.rotation),
              1e-6);
  }
}

TEST(CalibRead, ASizeThatTheFileStatesOtherwiseIsSaid) {
  const mvstudio::testing::TempDir folder;
  geometry::Rig rig;
  rig.cameras.emplace_back().camera = geometry::MakePinhole("a", 640, 480, 500);
  geometry::WriteRig(rig, folder / "calibration.json");
  CalibReadOptions options;
  options.size = {640, 480};
  EXPECT_FALSE(Warns(ReadCalibrationFiles({folder.path()}, options), "CAL-STATED-SIZE"));
  options.size = {1280, 960};
  const calib::ImportedRig read = ReadCalibrationFiles({folder.path()}, options);
  EXPECT_TRUE(Warns(read, "CAL-STATED-SIZE"));
  EXPECT_EQ(read.rig.cameras[0].camera.width_px, 640);
}

TEST(CalibRead, AUnitThatChangesNothingIsSaid) {
  const mvstudio::testing::TempDir folder;
  geometry::Rig rig;
  rig.cameras.emplace_back().camera = geometry::MakePinhole("a", 640, 480, 500);
  geometry::WriteRig(rig, folder / "calibration.json");
  CalibReadOptions options;
  EXPECT_FALSE(Warns(ReadCalibrationFiles({folder.path()}, options), "CAL-UNIT"));
  options.unit = calib::LengthUnit::kCentimetre;
  EXPECT_TRUE(Warns(ReadCalibrationFiles({folder.path()}, options), "CAL-UNIT"));
}

}  // namespace
}  // namespace mvstudio::stages
