#include <filesystem>

#include "core/disk/files.h"
#include "tests/cli/avatar_body_fixture.h"
#include "tests/support/test.h"

/// `avatar train --method gaussians`, `avatar eval` and `avatar render` of it, as a program.
namespace mvstudio {
namespace {

namespace fs = std::filesystem;

class AvatarGaussians : public AvatarBodyTest<AvatarGaussians> {
 protected:
  static CliRun Train(const std::string& name, const std::vector<std::string>& more) {
    return AvatarBodyTest::Train(name, "gaussians", more);
  }
};

TEST_F(AvatarGaussians, LearnsScoresAndRenders) {
  const CliRun run = Train("run", {"--steps", "60", "--threads", "1"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const auto metrics = run.Json()["metrics"];
  EXPECT_EQ(metrics["method"], "gaussians");
  EXPECT_EQ(metrics["steps"], 60);
  EXPECT_EQ(metrics["colour_degrees"].size(), 3u) << "trials without one of the four cameras";
  EXPECT_GT(metrics["gaussians"], 1000);
  for (const char* name :
       {"gaussians.npz", "gaussians.ply", "config.json", "body.npz", "history.csv", "samples/step_000060.png"})
    EXPECT_TRUE(fs::exists(out("run") + "/" + name)) << name;

  EXPECT_THAT(ReadFile(out("run") + "/history.csv"), ::testing::ContainsRegex("\n[012],0,,,,,"))
      << "no loss before the first step";

  const CliRun eval = RunCli({"avatar", "eval", out("run"), "--json", "--features", "gabor"});
  ASSERT_EQ(eval.exit, 0) << eval.err;
  const auto scores = eval.Json()["metrics"];
  EXPECT_GT(scores["holdout"]["ssim"], 0.6);
  EXPECT_GT(scores["holdout"]["mask_iou"], 0.8);
  EXPECT_TRUE(scores["baselines"].contains("body_alone"));
  EXPECT_EQ(scores["training"]["options"]["model.method"], "gaussians");

  const CliRun render = RunCli({"avatar", "render", out("run"), "--json", "--turntable", "3", "--size", "64", "--frames", "6"});
  ASSERT_EQ(render.exit, 0) << render.err;
  EXPECT_EQ(render.Json()["metrics"]["pictures"], 3);
  EXPECT_EQ(render.Json()["metrics"]["method"], "gaussians");

  EXPECT_THAT(Train("run", {"--steps", "10"}).err, HasSubstr("holds a trained avatar"));
  const std::string before = ReadFile(out("run") + "/gaussians.npz");
  const CliRun again = Train("run", {"--steps", "60", "--threads", "2", "--overwrite"});
  ASSERT_EQ(again.exit, 0) << again.err;
  EXPECT_FALSE(fs::exists(out("run") + "/protocol.json")) << "scores of the older run";
  EXPECT_THAT(RunCli({"avatar", "resume", out("run")}).err, HasSubstr("cannot be resumed"));
  EXPECT_EQ(RunCli({"avatar", "info", out("run")}).exit, 2);
  EXPECT_EQ(RunCli({"avatar", "render", out("run"), "--network-size", "64"}).exit, 2);
}

TEST_F(AvatarGaussians, ValidationImagesChooseTheDegree) {
  const CliRun run =
      Train("degrees", {"--steps", "20", "--save-every", "10", "--gaussians", "1500", "--validate-camera", "00_02"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const auto metrics = run.Json()["metrics"];
  ASSERT_EQ(metrics["colour_degrees"].size(), 3u);
  for (const auto& trial : metrics["colour_degrees"]) EXPECT_GT(trial["validation_ssim"], 0.3);
  EXPECT_EQ(Train("two", {"--steps", "5", "--colour-degree", "2", "--no-densify", "--no-mip-filter", "--gaussians", "500"})
                .Json()["metrics"]["gaussians"],
            500);
}

TEST_F(AvatarGaussians, WhatDoesNotApplyIsRefused) {
  for (const std::vector<std::string>& more : std::vector<std::vector<std::string>>{{"--width", "8"},
                                                                                    {"--learning-rate", "0.1"},
                                                                                    {"--patience", "2"},
                                                                                    {"--ranks", "2"},
                                                                                    {"--init-from", out("body")},
                                                                                    {"--gaussians", "-1"},
                                                                                    {"--colour-degree", "3"}}) {
    const CliRun run = Train("refused", more);
    EXPECT_EQ(run.exit, 2) << more[0];
    EXPECT_THAT(run.err, HasSubstr(more[0])) << more[0];
  }
  EXPECT_FALSE(fs::exists(out("refused")));
  const CliRun fit_off = RunCli({"avatar", "train", data(), "--out", out("refused"), "--method", "gaussians", "--fit", "off"});
  EXPECT_EQ(fit_off.exit, 2);
  const CliRun network = RunCli({"avatar", "train", data(), "--out", out("refused"), "--gaussians", "100"});
  EXPECT_EQ(network.exit, 2);
  EXPECT_THAT(network.err, HasSubstr("--method gaussians"));
}

}  // namespace
}  // namespace mvstudio
