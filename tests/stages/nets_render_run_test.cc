#include <filesystem>

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/evaluate/describe.h"
#include "stages/nets/render/describe.h"
#include "tests/stages/small_avatar.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

/// A small avatar rendered and scored, without the program.
namespace mvstudio::stages {
namespace {

std::vector<std::string> CodesSaid(const CommandResult& result) {
  std::vector<std::string> codes;
  for (const Notice& notice : result.warnings) codes.push_back(notice.code);
  return codes;
}

TEST(AvatarRenderStage, HeldOutCamerasAreRenderedAndScored) {
  const TempDir folder;
  RunContext run;
  run.num_threads = 1;
  RunAvatarTrain(SmallAvatar(folder), run);
  AvatarRenderOptions options;
  options.run_folder = folder / "run", options.frames = "2-3", options.render.size_px = 64;
  const AvatarRenderReport report = RunAvatarRender(options, run);
  EXPECT_EQ(report.method, avatar::Method::kTna);
  EXPECT_EQ(report.checkpoint_step, 3);
  EXPECT_EQ(report.trained_size_px, 48);
  EXPECT_THAT(report.plan.skipped, IsEmpty());
  ASSERT_THAT(report.outputs, SizeIs(2)) << "one camera is held out";
  EXPECT_EQ(report.outputs[1].path, folder / "run/render/00_03/00_03_00000003.png");
  const Image image = dataset::ReadImage(report.outputs[1].path);
  EXPECT_EQ(image.width, 64);
  EXPECT_EQ(image.height, 64);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.metrics["pictures"], 2);
  EXPECT_EQ(said.metrics["network_size_px"], 48);
  EXPECT_THAT(CodesSaid(said), IsEmpty());
  options.video = folder / "film.avi";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunAvatarRender(options, run); }), HasSubstr("option 'video'"));

  AvatarEvalOptions eval;
  eval.run_folder = folder / "run", eval.scores.features = "gabor", eval.scores.other_images = 0;
  const avatar::Evaluation evaluation = RunAvatarEval(eval, run).evaluation;
  EXPECT_EQ(evaluation.holdout_kind, "held-out cameras in held-out frames");
  EXPECT_EQ(evaluation.checkpoint_step, 3);
  ASSERT_THAT(evaluation.per_camera, SizeIs(1));
  EXPECT_EQ(evaluation.per_camera[0].name, "00_03");
  EXPECT_FALSE(evaluation.holdout.fd.has_value()) << "a single image";
  EXPECT_TRUE(std::filesystem::exists(folder / "run/protocol.json"));
}

TEST(AvatarRenderStage, WhatTheAvatarWasNotMadeForIsSaid) {
  AvatarRenderReport report;
  report.options.run_folder = "run", report.dataset = "data", report.options.render.turntable = 2;
  report.method = avatar::Method::kV2v;
  report.plan.jobs.resize(2), report.plan.foreign = true, report.plan.ratio = 0.8;
  report.plan.track.source = "walk.bvh";
  const CommandResult said = Describe(report);
  EXPECT_THAT(CodesSaid(said), ElementsAre("AVA-SCALE", "AVA-V2V-MOVING-CAMERA"));
  EXPECT_THAT(said.warnings[0].text, HasSubstr("1.25 times the trained person's"));
  EXPECT_EQ(said.text, "2 images of 1 view, 0 poses of walk.bvh, 0.000 s an image\n");
  report.plan.scaled = true, report.plan.skipped = {"cam frame 3"};
  EXPECT_EQ(Describe(report).exit, kExitPartial);
  EXPECT_THAT(CodesSaid(Describe(report)), ElementsAre("AVA-SKIPPED", "AVA-V2V-MOVING-CAMERA"));
}

TEST(AvatarEvalStage, AnAvatarNoBetterThanItsBaselinesIsSaidToBeSo) {
  AvatarEvalReport report;
  report.folder = "run";
  avatar::Evaluation& e = report.evaluation;
  e.holdout_kind = "held-out cameras in held-out frames", e.checkpoint_step = 600;
  e.intervals = {{"ssim", {}}, {"psnr_db", {}}};
  e.holdout.fd.emplace();
  e.holdout.mean.bbox.ssim = 0.8, e.holdout.mean.bbox.psnr_db = 20;
  e.mean_image.mean.bbox.ssim = 0.7, e.mean_image.mean.bbox.psnr_db = 18;
  e.nearest_pose = e.mean_image;
  EXPECT_THAT(CodesSaid(Describe(report)), IsEmpty());
  e.nearest_pose.mean.bbox.psnr_db = 21;
  e.body_alone = e.holdout;
  EXPECT_THAT(CodesSaid(Describe(report)), ElementsAre("AVA-BELOW-BASELINE", "AVA-NO-GAIN"));
  e.skipped = {"00_03 frame 3"}, e.holdout.fd.reset();
  EXPECT_EQ(Describe(report).exit, kExitPartial);
  EXPECT_THAT(CodesSaid(Describe(report)), ElementsAre("AVA-SKIPPED", "AVA-BELOW-BASELINE", "AVA-NO-GAIN", "AVA-NO-FD"));
}

}  // namespace
}  // namespace mvstudio::stages
