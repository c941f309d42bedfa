#include <filesystem>

#include "core/error.h"
#include "geometry/rig/rig_io.h"
#include "stages/calibrate/describe.h"
#include "stages/calibrate/run.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

const calib::testing::Scene& Boards() {
  static const calib::testing::Scene scene = [] {
    calib::testing::SceneOptions options;
    options.noise_px = 0.1;
    return calib::testing::MakeScene(options);
  }();
  return scene;
}

/// Corners of two cameras; `blind`: a third one that sees nothing.
CalibrateOptions BoardsToSolve(const TempDir& folder, bool blind = false) {
  calib::CornerFile file;
  for (const geometry::Camera& camera : Boards().truth.cameras) file.cameras.push_back({camera.name, 640, 480});
  if (blind) file.cameras.push_back({"blind", 640, 480});
  file.boards = {Boards().board}, file.detections = Boards().detections;
  calib::WriteCornerFile(file, folder / "corners.csv");
  CalibrateOptions options;
  options.corners.corners = folder / "corners.csv", options.out = folder / "calib";
  options.solve.model = geometry::LensModel::kBrown4, options.solve.holdout_folds = 0;
  return options;
}

/// Distance of the cameras of a stereo rig, m.
double BaselineM(const geometry::Rig& rig) {
  return (rig.cameras.at(0).CenterInWorld() - rig.cameras.at(1).CenterInWorld()).norm();
}

double TrueBaselineM() {
  const auto& poses = Boards().truth.cam_from_world;
  return (geometry::Inverse(poses[0]).translation - geometry::Inverse(poses[1]).translation).norm();
}

const calib::CalibrateReport& SolvedOf(const CalibrateReport& report) {
  return std::get<BoardCalibration>(report.found).solved.report;
}

TEST(CalibrateStage, CamerasAreThoseThatFilmedTheBoard) {
  const TempDir folder;
  const CalibrateReport report = RunCalibrate(BoardsToSolve(folder));
  const calib::CalibrateReport& solved = SolvedOf(report);
  ASSERT_EQ(solved.status, Status::kOk);
  ASSERT_EQ(solved.rig.cameras.size(), 2u);
  for (size_t c = 0; c < 2; ++c) EXPECT_NEAR(solved.rig.cameras[c].camera.fx(), Boards().truth.cameras[c].fx(), 2) << "px";
  EXPECT_NEAR(BaselineM(solved.rig), TrueBaselineM(), 1e-3);
  EXPECT_EQ(report.path, folder / "calib/calibration.json");
  EXPECT_NEAR(BaselineM(geometry::ReadRig(report.path)), TrueBaselineM(), 1e-3);
  EXPECT_TRUE(std::filesystem::exists(std::get<BoardCalibration>(report.found).poses_path));
  EXPECT_THAT(report.notes.inputs, ElementsAre(folder / "corners.csv"));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.folder, folder / "calib");
  EXPECT_THAT(said.errors, IsEmpty());
  EXPECT_EQ(said.metrics["cameras"].size(), 2u);
  EXPECT_EQ(said.outputs.at(0).path, report.path);
  EXPECT_THAT(said.text, HasSubstr("option 'world' board:FRAME")) << "nothing says where the floor is";
}

TEST(CalibrateStage, ACameraThatSawNothingIsLeftOutAndTheOthersStand) {
  const TempDir folder;
  const CalibrateReport report = RunCalibrate(BoardsToSolve(folder, true));
  const calib::SolvableCalibration& solved = std::get<BoardCalibration>(report.found).solved;
  EXPECT_EQ(solved.report.status, Status::kOk);
  ASSERT_EQ(solved.left_out.size(), 1u);
  EXPECT_EQ(solved.left_out[0].name, "blind");
  const CommandResult said = Describe(report);
  EXPECT_NE(said.exit, kExitOk);
  ASSERT_EQ(said.errors.size(), 1u);
  EXPECT_EQ(said.errors[0].code, "CAL-LEFTOUT");
}

TEST(CalibrateStage, TheFloorOfTheCalibrationThatIsReplacedStaysOrWhyNot) {
  const TempDir folder;
  CalibrateOptions options = BoardsToSolve(folder);
  options.solve.world.board_frame = Boards().truth.frames[3];
  const CalibrateReport first = RunCalibrate(options);
  EXPECT_FALSE(std::get<BoardCalibration>(first.found).earlier_world) << "the world is asked for";
  options.solve.world = {};
  const CalibrateReport again = RunCalibrate(options);
  const auto& earlier = std::get<BoardCalibration>(again.found).earlier_world;
  ASSERT_TRUE(earlier);
  EXPECT_EQ(earlier->gauge, geometry::RigGauge::OfBoard(Boards().truth.frames[3]));
  EXPECT_EQ(earlier->why_lost, "the board was filmed again") << "no record says what the first run read";
  EXPECT_EQ(Describe(again).warnings.at(0).code, "CAL-WORLD");
}

TEST(CalibrateStage, WhatIsMissingIsSaidBeforeAnythingIsRead) {
  EXPECT_THAT(MessageOf<UsageError>([] { RunCalibrate({}); }), HasSubstr("option 'out' is required"));
  const TempDir folder;
  CalibrateOptions options = BoardsToSolve(folder);
  options.lenses = folder / "lenses.json";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunCalibrate(options); }), HasSubstr("serial numbers"));
  EXPECT_FALSE(std::filesystem::exists(folder / "calib/calibration.json"));
}

TEST(CalibrateStage, AFailureKeepsItsWarningsAndNoInputs) {
  CalibrateReport report;
  report.notes.warnings = {{"CAL-UNUSED", "some images", ""}}, report.notes.inputs = {"corners.csv"};
  report.options.save_corners = "saved.csv", report.library_lenses = {"a"};
  calib::CalibrateReport& solved = std::get<BoardCalibration>(report.found).solved.report;
  solved.status = Status::kTooFewViews, solved.message = "camera a: 2 boards";
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitIllPosed);
  EXPECT_EQ(said.folder, "");
  EXPECT_EQ(said.metrics["status"], "TooFewViews");
  EXPECT_FALSE(said.metrics.contains("lenses_from_library"));
  ASSERT_EQ(said.errors.size(), 1u);
  EXPECT_EQ(said.errors[0].text, "camera a: 2 boards");
  EXPECT_EQ(said.warnings.size(), 1u);
  EXPECT_THAT(said.inputs, IsEmpty());
  EXPECT_EQ(said.outputs.at(0).role, "corners");
}

TEST(CalibrateStage, MarksThatPlaceNoCameraAreAnError) {
  CalibrateReport report;
  MarkedCalibration& marked = report.found.emplace<MarkedCalibration>();
  marked.placed.status = Status::kDegenerate, marked.placed.message = "marks in one plane";
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitIllPosed);
  EXPECT_EQ(said.errors.at(0).text, "marks in one plane");
  EXPECT_THAT(said.outputs, IsEmpty());
}

}  // namespace
}  // namespace mvstudio::stages
