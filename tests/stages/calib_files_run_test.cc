#include <filesystem>

#include "core/error.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib_files/describe.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

using ::testing::Pair;

class CalibFiles : public ::testing::Test {
 protected:
  CalibFiles() {
    calib::testing::SceneOptions scene;
    scene.num_cameras = 3, scene.num_frames = 2;
    rig_ = calib::testing::TruthRig(calib::testing::MakeScene(scene));
    geometry::WriteRig(rig_, file_);
  }

  TempDir folder_;
  std::string file_ = folder_ / "rig.json";
  geometry::Rig rig_;
};

TEST_F(CalibFiles, ConvertedThereAndBackNothingMoves) {
  CalibConvertOptions options;
  options.in = {file_}, options.to = "toml", options.out = folder_ / "rig.toml",
  options.out_unit = calib::LengthUnit::kMillimetre;
  options.rename = {"cam1=side"};
  const CalibConvertReport there = RunCalibConvert(options);
  EXPECT_EQ(there.format, "toml");
  EXPECT_EQ(there.folder, folder_.path());
  EXPECT_THAT(there.files, ElementsAre(options.out));
  options.in = {options.out}, options.to = "mvstudio", options.out = folder_ / "back.json", options.rename.clear();
  options.read.unit = calib::LengthUnit::kMillimetre;
  const CalibConvertReport back = RunCalibConvert(options);
  EXPECT_THAT(back.notes.inputs, ElementsAre(folder_ / "rig.toml"));
  const geometry::Rig read = geometry::ReadRig(folder_ / "back.json");
  ASSERT_EQ(read.Find("side"), 1);
  EXPECT_LT((read.cameras[1].CenterInWorld() - rig_.cameras[1].CenterInWorld()).norm(), 1e-6);
  const CommandResult said = Describe(back);
  EXPECT_EQ(said.metrics["num_cameras"], 3);
  EXPECT_EQ(said.metrics["format"], "mvstudio");
  EXPECT_EQ(said.outputs.at(0).path, folder_ / "back.json");
}

TEST_F(CalibFiles, PanopticNumbersTheCamerasAndSaysSo) {
  CalibConvertOptions options;
  options.in = {file_}, options.to = "panoptic", options.out = folder_ / "calibration_x.json";
  const CalibConvertReport report = RunCalibConvert(options);
  EXPECT_TRUE(report.renumbered);
  EXPECT_THAT(report.renamed, ElementsAre(Pair("cam0", "00_00"), Pair("cam1", "00_01"), Pair("cam2", "00_02")));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.metrics["renamed"]["cam2"], "00_02");
  EXPECT_EQ(said.warnings.back().code, "CAL-RENAMED");
  EXPECT_THAT(said.warnings.back().text, HasSubstr("cam0=00_00, cam1=00_01, cam2=00_02"));
}

TEST_F(CalibFiles, AWrongNameIsRefused) {
  CalibConvertOptions options;
  options.in = {file_}, options.out = folder_ / "new.json";
  options.rename = {"left=right"};
  EXPECT_THAT(MessageOf<UsageError>([&] { RunCalibConvert(options); }), HasSubstr("there is no camera 'left'"));
  options.rename = {"cam0=cam1"};
  EXPECT_THAT(MessageOf<UsageError>([&] { RunCalibConvert(options); }), HasSubstr("there is a camera 'cam1' already"));
  EXPECT_FALSE(std::filesystem::exists(options.out));
}

/// Closed form: half the resolution halves the focal lengths; a crop takes its corner off the principal point.
TEST_F(CalibFiles, ResizedLensesSeeTheSame) {
  const geometry::Camera& given = rig_.cameras[0].camera;
  CalibResizeOptions options;
  options.calibration = file_, options.out = folder_ / "new.json";
  options.camera_size = {"cam0=" + std::to_string(given.width_px / 2) + "x" + std::to_string(given.height_px / 2)};
  options.crop = {"cam1=10,20,300,200"};
  const CalibResizeReport report = RunCalibResize(options);
  ASSERT_EQ(report.cameras.size(), 2u);
  EXPECT_NEAR(report.cameras[0].after.fx(), given.fx() / 2, 1e-9);
  EXPECT_NEAR(report.cameras[1].after.cx(), rig_.cameras[1].camera.cx() - 10, 1e-9);
  EXPECT_NEAR(report.cameras[1].after.cy(), rig_.cameras[1].camera.cy() - 20, 1e-9);
  EXPECT_EQ(geometry::ReadRig(options.out).cameras[1].camera.width_px, 300);
  EXPECT_EQ(Describe(report).metrics["cameras"][1]["size_px"][1], 200);
  options.crop = {"10,20"}, options.out = folder_ / "other.json";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunCalibResize(options); }), HasSubstr("option 'crop' 10,20: expected"));
  options.crop.clear(), options.camera_size.clear();
  EXPECT_THAT(MessageOf<UsageError>([&] { RunCalibResize(options); }), HasSubstr("give the new size: option 'size'"));
}

TEST_F(CalibFiles, AnAddedLensIsListedAndItsCovarianceAskedFor) {
  LensAddOptions options;
  options.library = folder_ / "lenses.json", options.calibration = file_, options.camera = "cam1",
  options.key = {"123", "35mm"};
  const LensAddReport added = RunLensAdd(options);
  EXPECT_EQ(added.lens.camera.fx(), rig_.cameras[1].camera.fx());
  EXPECT_EQ(Describe(added).metrics["num_lenses"], 1);
  const CommandResult listed = Describe(RunLensList(options.library, false));
  EXPECT_EQ(listed.metrics["cameras"][0]["name"], "123@35mm");
  EXPECT_THAT(listed.warnings, IsEmpty());
  const CommandResult checked = Describe(RunLensList(options.library, true));
  EXPECT_EQ(checked.exit, kExitQualityGate);
  EXPECT_EQ(checked.warnings.back().code, "CAL-COVARIANCE-MISSING");
  options.camera = "left";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunLensAdd(options); }), HasSubstr("option 'camera' left"));
}

TEST_F(CalibFiles, ShownWithDistancesBetweenCameras) {
  CalibShowOptions options;
  options.in = {file_};
  const CommandResult said = Describe(RunCalibShow(options));
  const double wanted = (rig_.cameras[0].CenterInWorld() - rig_.cameras[2].CenterInWorld()).norm();
  EXPECT_NEAR(said.metrics["baselines_m"][0][2].get<double>(), wanted, 1e-9);
  EXPECT_THAT(said.text, HasSubstr("distances between cameras, m"));
  EXPECT_THAT(said.inputs, ElementsAre(file_));
}

}  // namespace
}  // namespace mvstudio::stages
