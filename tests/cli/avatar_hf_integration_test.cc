#include <filesystem>

#include "core/disk/files.h"
#include "tests/cli/avatar_body_fixture.h"
#include "tests/support/test.h"

/// `avatar train --method hf`, `avatar resume`, `avatar eval` and `avatar render` of it, as a program.
namespace mvstudio {
namespace {

namespace fs = std::filesystem;

class AvatarHf : public AvatarBodyTest<AvatarHf> {
 protected:
  static CliRun Train(const std::string& name, std::vector<std::string> more) {
    for (const char* word : {"--width", "4", "--downs", "3", "--threads", "1"}) more.push_back(word);
    return AvatarBodyTest::Train(name, "hf", more);
  }
};

TEST_F(AvatarHf, LearnsResumesScoresAndRenders) {
  const CliRun run = Train("run", {"--steps", "4"});
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.Json()["metrics"]["method"], "hf");
  for (const char* name : {"references.safetensors", "checkpoint.safetensors", "config.json", "body.npz", "textures.png"})
    EXPECT_TRUE(fs::exists(out("run") + "/" + name)) << name;

  const std::string references = ReadFile(out("run") + "/references.safetensors");
  ASSERT_EQ(Train("whole", {"--steps", "6"}).exit, 0);
  const CliRun resumed = RunCli({"avatar", "resume", out("run"), "--steps", "6", "--json", "--threads", "1"});
  ASSERT_EQ(resumed.exit, 0) << resumed.err;
  EXPECT_EQ(resumed.Json()["metrics"]["resumed_from"], 4);
  EXPECT_EQ(ReadFile(out("run") + "/references.safetensors"), references);
  EXPECT_EQ(ReadFile(out("whole") + "/references.safetensors"), references) << "the same choice each time";

  const CliRun eval = RunCli({"avatar", "eval", out("run"), "--json", "--features", "gabor"});
  ASSERT_EQ(eval.exit, 0) << eval.err;
  const auto scores = eval.Json()["metrics"];
  EXPECT_GT(scores["holdout"]["ssim"], 0.6);
  EXPECT_EQ(scores["training"]["options"]["model.method"], "hf");

  const CliRun render = RunCli({"avatar", "render", out("run"), "--json", "--turntable", "3", "--size", "64", "--frames", "6"});
  ASSERT_EQ(render.exit, 0) << render.err;
  EXPECT_EQ(render.Json()["metrics"]["pictures"], 3);

  // The run holds what it refers to: without it nothing is rendered.
  fs::remove(out("run") + "/references.safetensors");
  EXPECT_EQ(RunCli({"avatar", "eval", out("run")}).exit, 3);
  EXPECT_EQ(RunCli({"avatar", "render", out("run"), "--frames", "6", "--out", out("none")}).exit, 3);
  EXPECT_FALSE(fs::exists(out("none")));
}

TEST_F(AvatarHf, AnInterruptedRunEndsInTheSameBytes) {
  const std::vector<std::string> options = {"--steps", "6", "--decay-share", "0", "--references", "2"};
  ASSERT_EQ(Train("straight", options).exit, 0);
  ASSERT_EQ(Train("paused", {"--steps", "3", "--decay-share", "0", "--references", "2"}).exit, 0);
  ASSERT_EQ(RunCli({"avatar", "resume", out("paused"), "--steps", "6", "--threads", "1"}).exit, 0);
  const auto bytes = [&](const std::string& run) { return ReadFile(out(run) + "/checkpoint.safetensors"); };
  EXPECT_EQ(bytes("straight"), bytes("paused"));
}

TEST_F(AvatarHf, WithoutStepsItIsTheFittedBody) {
  const CliRun run = Train("none", {"--steps", "0"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const auto scores = RunCli({"avatar", "eval", out("none"), "--json", "--features", "gabor"}).Json()["metrics"];
  EXPECT_NEAR(scores["holdout"]["ssim"], scores["baselines"]["body_alone"]["ssim"], 2e-3);
}

TEST_F(AvatarHf, GoesOnFromAnotherRenderer) {
  ASSERT_EQ(Train("first", {"--steps", "3"}).exit, 0);
  const CliRun second = Train("second", {"--steps", "2", "--init-from", out("first"), "--references", "1"});
  ASSERT_EQ(second.exit, 0) << second.err;
  EXPECT_TRUE(second.Json()["metrics"]["init_from"]["fresh"].empty());
  EXPECT_THAT(Train("bad", {"--init-from", out("first"), "--references", "0"}).err, HasSubstr("--references 0"));
  ASSERT_EQ(RunCli({"avatar",      "train",
                    data(),        "--out",
                    out("direct"), "--method",
                    "direct",      "--body",
                    out("body"),   "--size",
                    "48",          "--width",
                    "4",           "--downs",
                    "3",           "--steps",
                    "1",           "--holdout-cameras",
                    "00_03",       "--holdout-frames",
                    "6-7"})
                .exit,
            0);
  const CliRun other = RunCli({"avatar", "train", data(), "--out", out("bad"), "--method", "hf", "--init-from", out("direct")});
  EXPECT_EQ(other.exit, 2);
  EXPECT_THAT(other.err, HasSubstr("shares no layer"));
  EXPECT_FALSE(fs::exists(out("bad")));
}

TEST_F(AvatarHf, SeveralPeopleTeachARenderer) {
  ASSERT_EQ(Train("a", {"--steps", "0"}).exit, 0);
  ASSERT_EQ(Train("b", {"--steps", "0", "--references", "1"}).exit, 0);
  const auto pretrain = [](const std::vector<std::string>& more) {
    std::vector<std::string> words = {"avatar", "pretrain-renderer", out("a"), out("b"), "--json", "--threads", "1"};
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  };
  const CliRun net = pretrain({"--out", out("net"), "--steps", "4"});
  ASSERT_EQ(net.exit, 0) << net.err;
  EXPECT_EQ(net.Json()["metrics"]["people"], 2);
  EXPECT_THAT(pretrain({"--out", out("net"), "--steps", "4"}).err, HasSubstr("holds a trained avatar"));
  ASSERT_EQ(pretrain({"--out", out("net2"), "--steps", "4"}).exit, 0);
  const auto bytes = [&](const std::string& run) { return ReadFile(out(run) + "/checkpoint.safetensors"); };
  EXPECT_EQ(bytes("net"), bytes("net2"));
  const CliRun next = Train("next", {"--steps", "0", "--init-from", out("net")});
  ASSERT_EQ(next.exit, 0) << next.err;
  EXPECT_EQ(next.Json()["warnings"].size(), 0u) << "it saw none of the frames that are held out";
  const CliRun seen = RunCli({"avatar", "train", data(), "--out", out("seen"), "--init-from", out("net"), "--json", "--steps",
                              "0", "--size", "48", "--train-cameras", "00_00,00_01", "--holdout-frames", "5-7"});
  ASSERT_EQ(seen.exit, 0) << seen.err;
  EXPECT_THAT(seen.Json()["warnings"].dump(), HasSubstr("AVA-PRETRAINED-SEEN"));
  ASSERT_EQ(Train("wide", {"--steps", "0", "--head-kernel", "5"}).exit, 0);
  const CliRun bad = RunCli({"avatar", "pretrain-renderer", out("a"), out("wide"), "--out", out("bad")});
  EXPECT_EQ(bad.exit, 2);
  EXPECT_THAT(bad.err, HasSubstr("--head-kernel"));
  EXPECT_EQ(RunCli({"avatar", "pretrain-renderer", out("body"), "--out", out("bad")}).exit, 3);
  EXPECT_FALSE(fs::exists(out("bad")));
}

TEST_F(AvatarHf, WhatDoesNotApplyIsRefused) {
  for (const std::vector<std::string>& more : std::vector<std::vector<std::string>>{{"--encoder-blocks", "2"},
                                                                                    {"--inputs", "21"},
                                                                                    {"--init-steps", "5"},
                                                                                    {"--references", "99"},
                                                                                    {"--reference-choice", "side"},
                                                                                    {"--prior", "none"},
                                                                                    {"--no-template-colours"},
                                                                                    {"--gaussians", "5"}}) {
    const CliRun run = Train("refused", more);
    EXPECT_EQ(run.exit, 2) << more[0];
    EXPECT_THAT(run.err, HasSubstr(more[0].substr(more[0].rfind("--no-", 0) == 0 ? 5 : 2))) << more[0];
  }
  const CliRun fit_off = RunCli({"avatar", "train", data(), "--out", out("refused"), "--method", "hf", "--fit", "off"});
  EXPECT_EQ(fit_off.exit, 2);
  EXPECT_THAT(fit_off.err, HasSubstr("--fit auto"));
  const CliRun tna = RunCli({"avatar", "train", data(), "--out", out("refused"), "--references", "2"});
  EXPECT_EQ(tna.exit, 2);
  EXPECT_THAT(tna.err, HasSubstr("--method hf"));
  EXPECT_FALSE(fs::exists(out("refused")));
}

}  // namespace
}  // namespace mvstudio
