#include "core/error.h"
#include "stages/nets/lift/describe.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

TEST(LiftStage, ALifterIsLearnedFromAllButTheLastFrames) {
  const TempDir folder;
  avatar::WriteMannequinDataset(folder / "data", 3, 8, 64);
  LiftTrainOptions options;
  options.datasets = {folder / "data"}, options.out = folder / "lifter.safetensors";
  options.baseline_poses = 64, options.net.width = 16, options.net.steps = 5;
  RunContext run;
  run.num_threads = 1;
  const LiftTrainReport report = RunLiftTrain(options, run);
  EXPECT_EQ(report.people, 1);
  EXPECT_LE(report.frames, 6) << "a quarter of the eight is held out";
  EXPECT_EQ(report.training.steps_done, 5);
  ASSERT_TRUE(report.holdout.has_value());
  EXPECT_EQ(report.holdout->all.mean_pose.frames, 6) << "two frames of each of three cameras";
  EXPECT_LE(report.holdout->all.lifter.frames, 6) << "after five steps it may place nobody before the camera";
  EXPECT_THAT(report.holdout->per_dataset, SizeIs(0)) << "only one";
  const avatar::Lifter kept = avatar::LoadLifter(options.out);
  EXPECT_NEAR(kept.size_m, report.size_m, 1e-6);
  EXPECT_NEAR(kept.sigma_m, report.holdout->all.sigma_m, 1e-6);
  options.holdout_share = 0.95;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunLiftTrain(options, run); }), HasSubstr("option 'holdout-share'"));
  LiftApplyOptions apply;
  apply.stride = 0;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunLiftApply(apply); }), HasSubstr("option 'stride'"));
}

TEST(LiftStage, SeveralDatasetsAreComparedOneByOne) {
  LiftTrainReport report;
  report.datasets = {"walk", "run"}, report.out = "lifter.safetensors";
  report.holdout.emplace();
  report.holdout->all.lifter.mpjpe_mm = 50;
  report.holdout->all.mean_pose.mpjpe_mm = report.holdout->all.nearest.mpjpe_mm = 80;
  report.holdout->per_dataset = {report.holdout->all, report.holdout->all};
  report.holdout->per_dataset[1].nearest.mpjpe_mm = 40;
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.metrics["holdout"]["lifter"]["mpjpe_mm"], 50);
  ASSERT_THAT(said.metrics["per_dataset"], SizeIs(2));
  EXPECT_EQ(said.metrics["per_dataset"][1]["dataset"], "run");
  EXPECT_EQ(said.metrics["per_dataset"][1]["holdout"]["nearest_neighbour"]["mpjpe_mm"], 40);
  ASSERT_THAT(said.warnings, SizeIs(1));
  EXPECT_THAT(said.warnings[0].text, HasSubstr("run: the lifter does not beat"));
}

TEST(LiftStage, FramesWithoutAPoseMakeItPartialOrIllPosed) {
  LiftApplyReport report;
  report.folder = "out", report.size_m = 1;
  report.frames[0].rms_px = 2;
  report.frames[1].status = Status::kTooFewViews;
  const CommandResult partial = Describe(report);
  EXPECT_EQ(partial.exit, kExitPartial);
  EXPECT_EQ(partial.text, "1 of 2 frames lifted\n");
  EXPECT_TRUE(partial.metrics["rate_hz"].is_null());
  report.frames.erase(0);
  const CommandResult none = Describe(report);
  EXPECT_EQ(none.exit, kExitIllPosed);
  ASSERT_THAT(none.errors, SizeIs(1));
  EXPECT_EQ(none.errors[0].code, "LIFT-FRAMES");
}

}  // namespace
}  // namespace mvstudio::stages
