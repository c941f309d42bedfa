#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "geometry/rig/rig_io.h"
#include "stages/align/describe.h"
#include "stages/align/run.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

/// A rig of three cameras, and points that lie twice as far apart in the new world, whose origin is at x = 1 m of the old one.
AlignOptions PairsToAlign(const TempDir& folder) {
  calib::testing::SceneOptions scene;
  scene.num_cameras = 3, scene.num_frames = 2;
  geometry::Rig rig = calib::testing::TruthRig(calib::testing::MakeScene(scene));
  rig.gauge = geometry::RigGauge::OfCamera("cam0");
  geometry::WriteRig(rig, folder / "rig.json");
  WriteFileAtomic(folder / "pairs.csv",
                  "point,x,y,z,x_old,y_old,z_old\na,0,0,0,1,0,0\nb,2,0,0,2,0,0\nc,0,2,0,1,1,0\nd,0,0,2,1,0,1\n");
  AlignOptions options;
  options.calibration = folder / "rig.json", options.out = folder / "new.json";
  options.points = {folder / "pairs.csv"}, options.scale = true;
  return options;
}

TEST(AlignStage, PointsOfBothWorldsMoveAndScaleTheRig) {
  const TempDir folder;
  const AlignReport report = RunAlign(PairsToAlign(folder));
  ASSERT_EQ(report.aligned.status, Status::kOk) << report.aligned.message;
  EXPECT_NEAR(report.aligned.scale, 2, 1e-12);
  const geometry::Rig given = geometry::ReadRig(folder / "rig.json"), written = geometry::ReadRig(folder / "new.json");
  const Eigen::Vector3d wanted = 2 * (given.cameras[1].CenterInWorld() - Eigen::Vector3d::UnitX());
  EXPECT_LT((written.cameras[1].CenterInWorld() - wanted).norm(), 1e-9);
  EXPECT_THAT(report.notes.inputs, ElementsAre(folder / "rig.json", folder / "pairs.csv"));
  const CommandResult said = Describe(report);
  EXPECT_THAT(said.errors, IsEmpty());
  EXPECT_EQ(said.outputs.at(0).path, folder / "new.json");
  EXPECT_EQ(said.metrics["camera_height_m"].size(), 3u);
  EXPECT_THAT(said.text, HasSubstr("4 of 4 points"));
}

TEST(AlignStage, OneWorldIsAskedForBeforeAnythingIsRead) {
  const TempDir folder;
  AlignOptions options = PairsToAlign(folder);
  options.floor_board = 3;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunAlign(options); }), HasSubstr("give one of option 'floor-board'"));
  options.points.clear();
  EXPECT_THAT(MessageOf<UsageError>([&] { RunAlign(options); }), HasSubstr("option 'scale' belongs to option 'points'"));
  options.scale = false;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunAlign(options); }), HasSubstr("needs the board's corners"));
  EXPECT_FALSE(std::filesystem::exists(folder / "new.json"));
}

TEST(AlignStage, AFloorThatFeetDoNotShowIsAnErrorWithItsFigures) {
  AlignReport report;
  report.options.floor_joints = "pose3d";
  report.floor.emplace();
  report.floor->status = report.aligned.status = Status::kTooFewViews;
  report.aligned.message = "feet stand in 2 places";
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitIllPosed);
  EXPECT_EQ(said.errors.at(0).text, "feet stand in 2 places");
  EXPECT_TRUE(said.metrics.contains("floor"));
  EXPECT_FALSE(said.metrics.contains("camera_height_m"));
  EXPECT_THAT(said.outputs, IsEmpty());
}

TEST(AlignStage, ABoardOffTheProjectionsAndCamerasBelowTheFloorAreWarnedOf) {
  AlignReport report;
  report.options.floor_board = 0;
  report.aligned.rms_px = 3;
  report.aligned.rig.cameras.emplace_back().cam_from_world.translation = Eigen::Vector3d(0, 0, 1);
  const CommandResult said = Describe(report);
  ASSERT_GE(said.warnings.size(), 2u);
  EXPECT_EQ(said.warnings[0].code, "CAL-ALIGN");
  EXPECT_EQ(said.warnings[1].code, "CAL-FLOOR");
}

}  // namespace
}  // namespace mvstudio::stages
