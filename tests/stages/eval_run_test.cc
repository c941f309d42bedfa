#include <filesystem>

#include "core/error.h"
#include "geometry/rig/rig_io.h"
#include "stages/eval/describe.h"
#include "stages/eval/run.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

/// Corners of four cameras, and their calibration but for `bump_rad`, by which the last one was turned since.
EvalOptions BoardsToCheck(const TempDir& folder, double bump_rad) {
  calib::testing::SceneOptions filmed;
  filmed.num_cameras = 4, filmed.noise_px = 0.1;
  const calib::testing::Scene scene = calib::testing::MakeScene(filmed);
  calib::CornerFile file;
  geometry::Rig rig;
  rig.gauge = geometry::RigGauge::OfBoard(0);
  for (size_t c = 0; c < scene.truth.cameras.size(); ++c) {
    file.cameras.push_back({scene.truth.cameras[c].name, 640, 480});
    rig.cameras.emplace_back();
    rig.cameras.back().camera = scene.truth.cameras[c];
    rig.cameras.back().cam_from_world = scene.truth.cam_from_world[c];
  }
  geometry::Rigid3 bump;
  bump.rotation = geometry::RotationExp({0, bump_rad, 0});
  rig.cameras.back().cam_from_world = bump * rig.cameras.back().cam_from_world;
  file.boards = {scene.board}, file.detections = scene.detections;
  calib::WriteCornerFile(file, folder / "corners.csv");
  geometry::WriteRig(rig, folder / "calibration.json");
  EvalOptions options;
  options.calibration = folder / "calibration.json", options.corners.corners = folder / "corners.csv";
  options.repair = folder / "repaired.json";
  return options;
}

TEST(EvalStage, TheCameraThatWasBumpedIsNamedAndRepaired) {
  const TempDir folder;
  const EvalReport report = RunEval(BoardsToCheck(folder, 0.02));
  EXPECT_THAT(report.check.moved, ElementsAre("cam3"));
  ASSERT_TRUE(report.Repaired());
  const geometry::Rig repaired = geometry::ReadRig(folder / "repaired.json");
  const geometry::Rigid3 left = repaired.cameras[3].cam_from_world * geometry::Inverse(report.rig.cameras[3].cam_from_world);
  EXPECT_NEAR(left.rotation.angularDistance(Eigen::Quaterniond::Identity()), 0.02, 1e-3);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.metrics["repaired"], nlohmann::ordered_json({"cam3"}));
  EXPECT_THAT(said.text, HasSubstr("MOVED"));
  EXPECT_EQ(said.outputs.at(0).path, folder / "repaired.json");
}

TEST(EvalStage, WhereNothingMovedNothingIsWritten) {
  const TempDir folder;
  const EvalReport report = RunEval(BoardsToCheck(folder, 0));
  EXPECT_THAT(report.check.moved, IsEmpty());
  EXPECT_FALSE(report.Repaired());
  EXPECT_FALSE(std::filesystem::exists(folder / "repaired.json"));
  EXPECT_THAT(Describe(report).text, HasSubstr("nothing to repair"));
}

TEST(EvalStage, CornersOfOtherCamerasAreRefused) {
  const TempDir folder;
  EvalOptions options = BoardsToCheck(folder, 0);
  geometry::Rig rig = geometry::ReadRig(options.calibration);
  for (geometry::RigCamera& camera : rig.cameras) camera.camera.name += "_of_another_rig";
  geometry::WriteRig(rig, options.calibration);
  EXPECT_THAT(MessageOf<FormatError>([&] { RunEval(options); }), HasSubstr("has no cam0, cam1, cam2, cam3"));
  options.calibration.clear();
  EXPECT_THAT(MessageOf<UsageError>([&] { RunEval(options); }), HasSubstr("CALIB is needed"));
}

TEST(EvalStage, AFailureSaysWhatToFilm) {
  EvalReport report;
  report.options.out = "check", report.options.repair = "repaired.json";
  report.check.status = Status::kTooFewViews, report.check.message = "no two cameras see a board at one time step";
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitIllPosed);
  EXPECT_EQ(said.folder, "check");
  EXPECT_EQ(said.errors.at(0).text, report.check.message);
  EXPECT_FALSE(said.metrics.contains("repaired"));
}

}  // namespace
}  // namespace mvstudio::stages
