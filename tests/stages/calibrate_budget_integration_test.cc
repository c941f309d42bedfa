#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "dataset/footage/image_io.h"
#include "stages/calibrate/describe.h"
#include "stages/calibrate/run.h"
#include "stages/tradeoff/predictions.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// calibrate with a budget or a target.
namespace mvstudio::stages {
namespace {

constexpr int kFrames = 48;

calib::testing::Scene Filmed(double noise_px) {
  calib::testing::SceneOptions options;
  options.num_frames = kFrames, options.noise_px = noise_px;
  return calib::testing::MakeScene(options);
}

/// Images of two cameras, with a given lens: its choice takes most of the time.
class CalibrateBudget : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TempDir>();
    const calib::testing::Scene scene = Filmed(0);
    const int num_cameras = static_cast<int>(scene.truth.cameras.size());
    for (const geometry::Camera& camera : scene.truth.cameras) std::filesystem::create_directory(*folder_ / camera.name);
    ParallelFor(num_cameras * kFrames, ResolveThreads(0), [&](int64_t i) {
      const auto c = static_cast<size_t>(i % num_cameras), f = static_cast<size_t>(i / num_cameras);
      const geometry::Rigid3 cam_from_board = scene.truth.cam_from_world[c] * scene.truth.world_from_board[f];
      dataset::WriteImage(calib::testing::RenderBoard(scene.board, scene.truth.cameras[c], cam_from_board, 1),
                          *folder_ / (scene.truth.cameras[c].name + Format("/%04d.png", static_cast<int>(f))));
    });
  }
  static void TearDownTestSuite() { folder_.reset(); }

  /// Every look at the clock takes a second.
  CalibrateOptions Options(const std::string& out) {
    CalibrateOptions options;
    options.corners.boards = {calib::ParseBoard("chessboard:9x6:60mm")};
    for (const char* name : {"cam0", "cam1"}) options.corners.cameras.push_back({name, *folder_ / name});
    options.corners.footage.cache.kind = CachePlace::Kind::kOff;
    options.solve.model = geometry::LensModel::kBrown4, options.solve.holdout_folds = 3;
    options.out = *folder_ / out, options.budget.now_s = [this] { return clock_s_ += 1; };
    return options;
  }
  static std::string Written(const std::string& out) { return ReadFile(*folder_ / out + "/calibration.json"); }

  static std::unique_ptr<TempDir> folder_;
  double clock_s_ = 0;
};

std::unique_ptr<TempDir> CalibrateBudget::folder_;

/// With time enough all images are taken, as without a budget.
TEST_F(CalibrateBudget, WithTimeForAllImagesTheyAreTaken) {
  CalibrateOptions options = Options("all");
  options.budget.budget = "1h";
  const CalibrateReport report = RunCalibrate(options);
  ASSERT_TRUE(report.budget);
  ASSERT_EQ(report.budget->trials.size(), 3u) << "every 4th, every 2nd, all: 12, 24 and 48 images";
  EXPECT_EQ(report.budget->trials[0].size, 12);
  EXPECT_EQ(report.budget->trials[2].size, kFrames);
  EXPECT_TRUE(report.budget->Chosen().flags.empty());
  RunCalibrate(Options("plain"));
  EXPECT_EQ(Written("all"), Written("plain"));
  EXPECT_GT(report.budget->actual_error, 0);
  EXPECT_NEAR(report.budget->Chosen().error, report.budget->actual_error, 0.5 * report.budget->actual_error);
  const CommandResult said = Describe(report);
  EXPECT_THAT(said.text, HasSubstr("option 'every': 48 of 48 images a camera are searched"));
  EXPECT_EQ(said.metrics["budget"]["error_unit"], "px");
}

/// What the trial measured is what comes out of the same images, and what the flags give by hand.
TEST_F(CalibrateBudget, ASmallBudgetThinsTheImages) {
  CalibrateOptions options = Options("foretold");
  options.budget.target = "1000px";
  const CalibrateReport easy = RunCalibrate(options);
  const SettingTrial &chosen = easy.budget->Chosen(), &next = easy.budget->trials[1];
  ASSERT_EQ(chosen.flags, (std::vector<std::pair<std::string, std::string>>{{"every", "4"}})) << "the cheapest reaches it";
  EXPECT_NEAR(easy.budget->actual_error, chosen.error, 1e-9 * chosen.error);
  EXPECT_LT(chosen.predicted_s, next.predicted_s);
  CalibrateOptions by_hand = Options("by_hand");
  by_hand.corners.footage.every = 4;
  RunCalibrate(by_hand);
  EXPECT_EQ(Written("foretold"), Written("by_hand"));

  PredictionsOptions kept;
  kept.files = {*folder_ / "foretold"};
  const PredictionsReport predictions = RunPredictions(kept);
  ASSERT_EQ(predictions.predictions.size(), 1u);
  EXPECT_EQ(predictions.predictions[0].stage, "calibrate");
  EXPECT_EQ(predictions.predictions[0].frames, kFrames);
  EXPECT_EQ(predictions.predictions[0].error_unit, "px");
  EXPECT_DOUBLE_EQ(predictions.predictions[0].predicted_s, chosen.predicted_s);
}

/// The held-out error says nothing of the image's sides: what is needed there counts, too.
TEST_F(CalibrateBudget, SidesAsCertainAsIsNeededBelongToATarget) {
  CalibrateOptions options = Options("need");
  options.budget.target = "1000px", options.solve.need_px = 1e-6;
  const CalibrateReport report = RunCalibrate(options);
  EXPECT_EQ(report.budget->choice.outcome, SettingChoice::Outcome::kBestWithinBudget);
  EXPECT_TRUE(report.budget->Chosen().flags.empty()) << "all images";
  EXPECT_THAT(report.budget->trials[0].short_of, HasSubstr("option 'need'"));
}

TEST_F(CalibrateBudget, WhatCannotBeReachedIsSaid) {
  CalibrateOptions options = Options("unreached");
  options.budget.target = "0.0001px";
  const CommandResult said = Describe(RunCalibrate(options));
  const auto named = [](const Notice& warning) { return warning.code == "BUD-TARGET"; };
  EXPECT_EQ(std::count_if(said.warnings.begin(), said.warnings.end(), named), 1);
  options = Options("refused");
  options.budget.budget = "1ms";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunCalibrate(options); }), HasSubstr("option 'every' 4, is predicted to take"));
  EXPECT_FALSE(std::filesystem::exists(*folder_ / "refused/calibration.json"));
}

/// What was given is not chosen, a board that defines the world is searched.
TEST_F(CalibrateBudget, WhatWasGivenStays) {
  CalibrateOptions options = Options("given");
  options.corners.footage.every = 3, options.budget.target = "1000px";
  CalibrateReport report = RunCalibrate(options);
  EXPECT_EQ(report.budget->trials.size(), 1u);
  EXPECT_EQ(report.options.corners.footage.every, 3);
  options = Options("world");
  options.solve.world.board_frame = 6, options.budget.target = "1000px";
  report = RunCalibrate(options);
  ASSERT_EQ(report.budget->trials.size(), 2u) << "every 4th image would leave frame 6 out";
  EXPECT_EQ(report.options.corners.footage.every, 2);
  EXPECT_EQ(std::get<BoardCalibration>(report.found).solved.report.rig.gauge, geometry::RigGauge::OfBoard(6));
}

/// A file of corners leaves the lens to choose. The flags by hand give the same calibration.
TEST_F(CalibrateBudget, OfAFileOfCornersTheLensIsChosen) {
  const calib::testing::Scene scene = Filmed(0.1);
  calib::CornerFile file;
  for (const geometry::Camera& camera : scene.truth.cameras) file.cameras.push_back({camera.name, 640, 480});
  file.boards = {scene.board}, file.detections = scene.detections;
  calib::WriteCornerFile(file, *folder_ / "corners.csv");
  CalibrateOptions options;
  options.corners.corners = *folder_ / "corners.csv", options.out = *folder_ / "file";
  options.budget.budget = "1h";
  const CalibrateReport report = RunCalibrate(options);
  const SettingTrial& chosen = report.budget->Chosen();
  EXPECT_EQ(report.budget->trials.back().flags.size(), 0u) << "the lens as the command chooses it";
  EXPECT_EQ(chosen.size, kFrames);
  options.budget.budget.clear(), options.out = *folder_ / "file_by_hand";
  if (!chosen.flags.empty()) FromString(chosen.flags[0].second, "model", &options.solve.model);
  RunCalibrate(options);
  EXPECT_EQ(Written("file"), Written("file_by_hand"));
}

TEST_F(CalibrateBudget, WithoutABoardThereIsNothingToChoose) {
  CalibrateOptions options = Options("scene");
  options.scene.from_scene = "images", options.budget.budget = "1h";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunCalibrate(options); }), HasSubstr("without a board"));
  options = Options("scene");
  options.budget.target = "1mm";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunCalibrate(options); }), HasSubstr("held-out error in px"));
  options.budget.budget = "soon";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunCalibrate(options); }), HasSubstr("option 'budget' 'soon'"));
}

}  // namespace
}  // namespace mvstudio::stages
