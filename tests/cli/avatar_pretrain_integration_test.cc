#include <filesystem>

#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/folder_state.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// `avatar pretrain` as a program, and avatars of two methods that begin with its network.
namespace mvstudio {
namespace {

namespace fs = std::filesystem;

class AvatarPretrain : public ::testing::Test {
 protected:
  AvatarPretrain() { avatar::WriteMannequinDataset(data(), 3, 8, 64); }
  std::string data() const { return folder_ / "data"; }
  std::string out(const std::string& name) const { return folder_ / name; }
  CliRun Run(std::vector<std::string> words, const std::vector<std::string>& more) const {
    words.insert(words.end(), more.begin(), more.end());
    words.insert(words.end(), {"--json", "--threads", "2"});
    return RunCli(words);
  }
  CliRun Pretrain(const std::vector<std::string>& more) const {
    return Run({"avatar",           "pretrain", "--out",     out("net"), "--size",           "32",
                "--width",          "4",        "--downs",   "2",        "--encoder-blocks", "1",
                "--decoder-blocks", "1",        "--samples", "4",        "--scored-samples", "4",
                "--steps",          "4"},
               more);
  }
  CliRun Train(const std::string& name, const std::vector<std::string>& more) const {
    return Run({"avatar", "train", data(), "--out", out(name), "--init-from", out("net"), "--size", "32", "--steps", "2",
                "--fit", "off", "--holdout-cameras", "00_02", "--holdout-frames", "6-7", "--validate-pictures", "0"},
               more);
  }

  testing::TempDir folder_;
};

TEST_F(AvatarPretrain, AvatarsOfEveryMethodBeginWithItsNetwork) {
  const CliRun first = Pretrain({"--poses", data() + ":0-5"});
  ASSERT_EQ(first.exit, 0) << first.err;
  const auto metrics = first.Json()["metrics"];
  EXPECT_EQ(metrics["sources"][0]["frames"], "0-5");
  EXPECT_EQ(metrics["scores"]["held_out"]["samples"], 4);
  EXPECT_TRUE(fs::exists(out("net") + "/avatar_pretrain.result.json"));
  EXPECT_EQ(Pretrain({"--poses", data() + ":0-5"}).Json()["metrics"]["cached"], true);

  const CliRun tna = Train("tna", {"--method", "tna"});
  ASSERT_EQ(tna.exit, 0) << tna.err;
  EXPECT_EQ(tna.Json()["metrics"]["steps"], 2) << "no initialisation";
  EXPECT_EQ(tna.Json()["metrics"]["init_from"]["fresh"].size(), 0u);
  EXPECT_EQ(tna.Json()["warnings"].size(), 0u) << tna.out;
  for (const std::string method : {"direct", "v2v"}) {
    const CliRun run = Train(method, {"--method", method});
    ASSERT_EQ(run.exit, 0) << run.err;
    const auto m = run.Json()["metrics"];
    EXPECT_EQ(m["method"], method);
    EXPECT_EQ(m["steps"], 2);
    EXPECT_EQ(m["init_from"]["method"], "tna");
    EXPECT_EQ(m["init_from"]["fresh"], nlohmann::json({"colour_decoder.head", "mask_decoder.head"}));
    EXPECT_EQ(m["init_from"]["partly"].size(), method == "v2v" ? 1u : 0u);
    EXPECT_EQ(RunCli({"avatar", "eval", out(method), "--features", "gabor"}).exit, 0);
  }
  const CliRun refused = Train("wide", {"--method", "direct", "--width", "8"});
  EXPECT_EQ(refused.exit, 2);
  EXPECT_THAT(refused.Json()["errors"][0]["text"].get<std::string>(), HasSubstr("--width 8"));
}

TEST_F(AvatarPretrain, PosesOfHeldOutFramesAreToldOf) {
  ASSERT_EQ(Pretrain({"--poses", data()}).exit, 0);
  const CliRun run = Train("seen", {});
  ASSERT_EQ(run.exit, 0) << run.err;
  ASSERT_EQ(run.Json()["warnings"].size(), 1u);
  EXPECT_EQ(run.Json()["warnings"][0]["code"], "AVA-PRETRAINED-SEEN");
}

TEST_F(AvatarPretrain, BadInputIsRefusedInOneLineAndNothingIsWritten) {
  const auto refused = [&](const std::vector<std::string>& more, int exit, const std::string& words) {
    const CliRun run = Pretrain(more);
    EXPECT_EQ(run.exit, exit) << run.out;
    EXPECT_THAT(run.Json()["errors"][0]["text"].get<std::string>(), HasSubstr(words));
    EXPECT_FALSE(fs::exists(out("net"))) << words;
  };
  refused({}, 2, "--motion");
  refused({"--poses", data() + ":0-99"}, 2, "frame 8 is not in");
  refused({"--poses", out("nothing")}, 3, "no such folder");
  refused({"--motion", data()}, 3, "no .bvh file");
  refused({"--poses", data(), "--template", out("nothing")}, 2, "--template");
  refused({"--poses", data(), "--min-extent", "0.9"}, 2, "--min-extent");
  refused({"--poses", data(), "--batch", "0"}, 2, "batch");
  const CliRun size = Run({"avatar", "pretrain", "--out", out("net"), "--poses", data(), "--samples", "2", "--size", "30"}, {});
  EXPECT_EQ(size.exit, 2);
  EXPECT_THAT(size.Json()["errors"][0]["text"].get<std::string>(), HasSubstr("--size 30"));
  EXPECT_FALSE(fs::exists(out("net")));
}

TEST_F(AvatarPretrain, FilesOfOthersStay) {
  fs::create_directories(out("net"));
  testing::CliRun run = Pretrain({"--poses", data()});
  ASSERT_EQ(run.exit, 0) << run.err;
  testing::Put(out("net") + "/notes.txt", "mine");
  EXPECT_EQ(Pretrain({"--poses", data(), "--seed", "2"}).exit, 2);
  run = Pretrain({"--poses", data(), "--seed", "2", "--overwrite"});
  EXPECT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(testing::Slurp(out("net") + "/notes.txt"), "mine");
}

}  // namespace
}  // namespace mvstudio
