#include <filesystem>

#include "avatar/run/pack/run_config.h"
#include "core/error.h"
#include "stages/nets/train/describe.h"
#include "stages/nets/train/run.h"
#include "tests/stages/small_avatar.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

TEST(AvatarTrainStage, ANetworkIsTrainedAndGoesOn) {
  const TempDir folder;
  const AvatarTrainOptions options = SmallAvatar(folder);
  RunContext run;
  run.num_threads = 1;
  const AvatarTrainReport report = RunAvatarTrain(options, run);
  ASSERT_TRUE(report.network.has_value());
  EXPECT_EQ(report.network->report.status, Status::kOk) << report.network->report.message;
  EXPECT_EQ(report.images, 9) << "3 cameras of 3 frames";
  EXPECT_EQ(report.steps, 3);
  EXPECT_FALSE(report.gaussians || report.fit || report.body_alone);
  const avatar::AvatarModel kept = avatar::LoadModel(folder / "run/checkpoint.safetensors");
  EXPECT_EQ(kept.step, 3);
  EXPECT_EQ(report.num_parameters, avatar::NumParameters(kept.options));
  EXPECT_THAT(MessageOf<UsageError>([&] { RunAvatarTrain(options, run); }), HasSubstr("option 'overwrite'"));

  AvatarResumeOptions more;
  more.run = folder / "run", more.steps = 5;
  const AvatarTrainReport resumed = RunAvatarResume(more, run);
  EXPECT_EQ(resumed.resumed_from, 3);
  EXPECT_EQ(resumed.steps, 5);
  EXPECT_EQ(resumed.network->report.steps_done, 2);
  const CommandResult done = Describe(RunAvatarResume(more, run));
  ASSERT_THAT(done.warnings, SizeIs(1));
  EXPECT_EQ(done.warnings[0].code, "AVA-NOTHING-TO-DO");
}

/// A training that was cut off before its first checkpoint: nothing says to resume it.
TEST(AvatarTrainStage, WithoutACheckpointItBeginsAgain) {
  const TempDir folder;
  RunContext run;
  run.num_threads = 1;
  AvatarTrainOptions options = SmallAvatar(folder);
  RunAvatarTrain(options, run);
  std::filesystem::remove(folder / "run/checkpoint.safetensors");
  AvatarResumeOptions more;
  more.run = folder / "run";
  const auto same_again = HasSubstr("begin it again with the same `mvstudio avatar train`");
  EXPECT_THAT(MessageOf<IoError>([&] { RunAvatarResume(more, run); }), same_again);
  EXPECT_THAT(MessageOf<IoError>([&] { avatar::OpenRun(folder / "run", ""); }), same_again);
  EXPECT_NO_THROW(RunAvatarTrain(options, run)) << "as the message says";
}

TEST(AvatarTrainStage, OptionsOfOtherMethodsAreRefused) {
  const TempDir folder;
  AvatarTrainOptions options = SmallAvatar(folder);
  options.given.insert("colour-degree");
  EXPECT_THAT(MessageOf<UsageError>([&] { RunAvatarTrain(options); }),
              HasSubstr("option 'colour-degree' needs option 'method' gaussians"));
  options.model.method = avatar::Method::kGaussians;
  options.given = {"width"};
  EXPECT_THAT(MessageOf<UsageError>([&] { RunAvatarTrain(options); }), HasSubstr("option 'width' is of the networks"));
  options.given = {};
  EXPECT_THAT(MessageOf<UsageError>([&] { RunAvatarTrain(options); }), HasSubstr("option 'fit' auto"));
  EXPECT_FALSE(std::filesystem::exists(folder / "run")) << "refused before anything is written";
}

TEST(AvatarTrainStage, OtherRanksSayNothing) {
  AvatarTrainReport report;
  report.rank = 1, report.folder = "run";
  EXPECT_EQ(Describe(report).folder, "");
  EXPECT_TRUE(Describe(report).metrics.empty());
}

AvatarTrainReport Made() {
  AvatarTrainReport report;
  report.dataset = "data", report.folder = "run", report.config.dataset = "/data";
  report.method = avatar::Method::kTna, report.steps = 600, report.num_parameters = 1234, report.images = 9;
  report.wall_s = 12.4, report.whole_s = 30.6;
  report.network.emplace();
  report.network->report.gain = 0.004, report.network->report.network_off = true, report.network->least_gain = 0.01;
  return report;
}

TEST(AvatarTrainStage, TheSummaryComesFirstAndTheGainAfterIt) {
  const CommandResult said = Describe(Made());
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_THAT(said.inputs, ElementsAre("/data"));
  EXPECT_EQ(said.text,
            "avatar (tna, 1234 parameters) trained on 9 images of 0 cameras: 600 steps in 12 s, 31 s in all\n  run\n"
            "on the validation images the network adds 0.0040 of SSIM to the fitted body, less than 0.01: left out (option "
            "'least-gain' 0 keeps it)\n");
  EXPECT_EQ(said.metrics["network"]["kept"], false);
}

TEST(AvatarTrainStage, WhatIsWrongDecidesTheExit) {
  AvatarTrainReport report = Made();
  report.packs.skipped = {"00_00 frame 2"};
  report.conflicts = {{"DAT-COVER", "masks: of another take", ""}};
  const CommandResult skipped = Describe(report);
  EXPECT_TRUE(skipped.partial);
  ASSERT_THAT(skipped.warnings, SizeIs(2));
  EXPECT_EQ(skipped.warnings[0].code, "AVA-SKIPPED");
  EXPECT_EQ(skipped.warnings[1].code, "DAT-COVER");
  report.network->report.status = Status::kNonFiniteInput;
  EXPECT_EQ(Describe(report).exit, kExitIllPosed);
  report.fit.emplace();  // on no mask of any camera
  EXPECT_EQ(Describe(report).exit, kExitQualityGate);
}

}  // namespace
}  // namespace mvstudio::stages
