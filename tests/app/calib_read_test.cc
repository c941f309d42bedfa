#include "app/input/calib_read.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/random.h"
#include "core/units.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::app {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;

/// Pinhole cameras side by side along x.
geometry::Rig Row(const std::vector<double>& x_m) {
  geometry::Rig rig;
  rig.gauge = "test";
  for (const double x : x_m) {
    geometry::RigCamera camera;
    camera.camera = geometry::MakePinhole("cam_" + std::to_string(rig.cameras.size()), 640, 480, 500);
    camera.cam_from_world.translation = {-x, 0, 0};
    rig.cameras.push_back(camera);
  }
  return rig;
}

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

TEST(CalibRead, MoreThanHalfAroundCountsAsSuch) {
  geometry::Camera fisheye = geometry::MakePinhole("a", 1000, 1000, 250);  // 250 px a radian, 1000 px: 4 radians
  fisheye.model = geometry::LensModel::kKannalaBrandt4;
  fisheye.params.conservativeResize(8);
  fisheye.params.tail(4).setZero();
  EXPECT_NEAR(FieldOfViewDeg(fisheye)[0], RadToDeg(4.0), 1e-6);
}

TEST(CalibRead, SigmasAreThoseOfTheCovariance) {
  Rng rng(5);
  for (int trial = 0; trial < 10; ++trial) {
    geometry::RigCamera camera = Row({0}).cameras[0];
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

TEST(CalibRead, WithoutCovarianceThereAreNoSigmas) {
  const geometry::Rig rig = Row({0, 2});
  const CameraSigmas sigmas = SigmasOf(rig.cameras[0]);
  EXPECT_TRUE(std::isnan(sigmas.focal_px) && std::isnan(sigmas.rotation_rad) && std::isnan(sigmas.position_m));
  CommandResult result;
  AddCameraMetrics(rig, &result);
  const nlohmann::json metrics = nlohmann::json::parse(result.metrics.dump());
  EXPECT_EQ(metrics["num_cameras"], 2);
  const auto& second = metrics["cameras"][1];
  EXPECT_EQ(second["name"], "cam_1");
  EXPECT_EQ(second["center_in_world_m"], nlohmann::json::array({2.0, 0.0, 0.0}));
  EXPECT_NEAR(second["fov_deg"][0].get<double>(), RadToDeg(2 * std::atan(320.0 / 500)), 1e-9);
  for (const char* unknown : {"sigma_focal_px", "sigma_rotation_deg", "sigma_position_mm", "valid_radius"}) {
    EXPECT_TRUE(second[unknown].is_null()) << unknown;
  }
  EXPECT_FALSE(second.contains("time_offset"));
}

TEST(CalibRead, SizesThatAreNoneAreRefusedBeforeAnyFileIsRead) {
  for (const std::string size : {"640", "640x", "x480", "0x480", "640x-480", "640x480px", "640x480x3"}) {
    CalibReadOptions options;
    options.size = size;
    EXPECT_THAT(MessageOf<UsageError>([&] { ReadCalibrationFiles({"/nowhere/c.json"}, options); }),
                HasSubstr("option 'size' " + size));
  }
  CalibReadOptions panoptic;
  panoptic.from = "panoptic";
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadCalibrationFiles({"a.json", "b.json"}, panoptic); }), HasSubstr("b.json"));
  EXPECT_THAT(MessageOf<IoError>([] { ReadCalibrationFiles({"/nowhere/c.json"}, {}); }), HasSubstr("/nowhere/c.json"));
}

TEST(CalibRead, AnyFormatIsReadAndWhatIsDoubtfulOfItIsNoted) {
  const TempDir folder;
  geometry::WriteRig(Row({0, 2}), folder / "near.json");
  const calib::ImportedRig near = ReadCalibrationFiles({folder / "near.json"}, {});
  EXPECT_TRUE(near.notes.empty());
  ASSERT_EQ(near.rig.cameras.size(), 2u);
  EXPECT_NEAR(near.rig.cameras[1].CenterInWorld().x(), 2, 1e-12);
  geometry::WriteRig(Row({0, 2000}), folder / "far.json");
  const calib::ImportedRig far = ReadCalibrationFiles({folder / "far.json"}, {});
  ASSERT_EQ(far.notes.size(), 1u);
  EXPECT_EQ(far.notes[0].code, "CAL-DISTANCES");
  CommandResult from_notes, from_rig;
  AddNotes(far.notes, &from_notes);
  AddDoubts(far.rig, &from_rig);
  ASSERT_EQ(from_notes.warnings.size(), 1u);
  ASSERT_EQ(from_rig.warnings.size(), 1u);
  EXPECT_EQ(from_notes.warnings[0].text, from_rig.warnings[0].text);
  EXPECT_EQ(from_notes.warnings[0].hint, from_rig.warnings[0].hint);
}

TEST(CalibRead, EveryChoiceIsAFormat) {
  std::vector<std::string> choices = CalibrationFormatChoices(true);
  EXPECT_EQ(choices[0], "auto");
  choices.erase(choices.begin());
  EXPECT_EQ(choices, CalibrationFormatChoices(false));
  EXPECT_GE(choices.size(), std::size(calib::kAllCalibrationFormats));
  for (const std::string& name : choices) EXPECT_TRUE(calib::CalibrationFormatFromString(name)) << name;
  for (const auto format : calib::kAllCalibrationFormats) {
    EXPECT_THAT(CalibrationFormatNames(), HasSubstr(std::string(calib::ToString(format))));
  }
  EXPECT_EQ(MetresPerUnit("mm"), 0.001);
  EXPECT_EQ(MetresPerUnit("cm"), 0.01);
  EXPECT_EQ(MetresPerUnit("m"), 1);
}

}  // namespace
}  // namespace mvstudio::app
