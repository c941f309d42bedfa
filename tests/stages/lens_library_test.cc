#include "stages/calib/lens_library.h"

#include "calib/calibrate.h"
#include "core/error.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

geometry::RigCamera CameraOf(double focal_px) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("left", 640, 480, focal_px);
  camera.cam_from_world.translation = Eigen::Vector3d(1, 2, 3);
  camera.params_covariance = Eigen::MatrixXd::Identity(4, 4);
  camera.cam_from_world_covariance = Eigen::Matrix<double, 6, 6>::Identity();
  return camera;
}

dataset::SessionCamera Named(const std::string& name, const std::string& serial, const std::string& lens = "") {
  return {name, serial, lens, 0, 0};
}

TEST(LensLibrary, KeepsLensesWithoutPosesThroughAFile) {
  const testing::TempDir folder;
  geometry::Rig library;
  AddLens(CameraOf(500), {"123", "35mm"}, false, &library);
  geometry::WriteRig(library, folder / "lenses.json");
  const geometry::Rig read = ReadLensLibrary(folder / "lenses.json");
  ASSERT_EQ(read.cameras.size(), 1u);
  EXPECT_EQ(read.cameras[0].camera.name, "123@35mm");
  EXPECT_EQ(read.cameras[0].camera.fx(), 500);
  EXPECT_EQ(read.cameras[0].cam_from_world.translation.norm(), 0);
  EXPECT_TRUE(read.cameras[0].params_covariance);
  EXPECT_FALSE(read.cameras[0].cam_from_world_covariance);
}

TEST(LensLibrary, ACalibrationIsNone) {
  const testing::TempDir folder;
  geometry::Rig rig;
  rig.cameras = {CameraOf(500)};
  geometry::WriteRig(rig, folder / "calibration.json");
  EXPECT_THROW(ReadLensLibrary(folder / "calibration.json"), FormatError);
}

TEST(LensLibrary, ALensIsReplacedOnlyWhenAsked) {
  geometry::Rig library;
  AddLens(CameraOf(500), {"123", ""}, false, &library);
  EXPECT_THROW(AddLens(CameraOf(600), {"123", ""}, false, &library), UsageError);
  AddLens(CameraOf(600), {"123", ""}, true, &library);
  ASSERT_EQ(library.cameras.size(), 1u);
  EXPECT_EQ(library.cameras[0].camera.fx(), 600);
  EXPECT_THROW(AddLens(CameraOf(600), {"", "wide"}, false, &library), UsageError);
  EXPECT_THROW(AddLens(CameraOf(600), {"1@2", "wide"}, false, &library), UsageError);
}

TEST(LensesOf, FindsThemBySerialAndSetting) {
  geometry::Rig library;
  AddLens(CameraOf(500), {"123", "near"}, false, &library);
  AddLens(CameraOf(510), {"123", "far"}, false, &library);
  AddLens(CameraOf(700), {"456", "any"}, false, &library);
  const geometry::Rig lenses =
      LensesOf(library, {Named("a", "123", "far"), Named("b", "456"), Named("c", "789"), Named("d", "")});
  ASSERT_EQ(lenses.cameras.size(), 2u);
  EXPECT_EQ(lenses.gauge, calib::kLensesOnly);
  EXPECT_EQ(lenses.cameras[0].camera.name, "a");
  EXPECT_EQ(lenses.cameras[0].camera.fx(), 510);
  EXPECT_EQ(lenses.cameras[1].camera.fx(), 700);
  EXPECT_THAT(testing::MessageOf<UsageError>([&] { LensesOf(library, {Named("a", "123")}); }), HasSubstr("near; far"));
  EXPECT_THAT(LensesOf(library, {}).cameras, IsEmpty());
}

}  // namespace
}  // namespace mvstudio::stages
