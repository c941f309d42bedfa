#include <filesystem>

#include "core/disk/files.h"
#include "dataset/footage/image_io.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// `avatar render` as a program: what it writes where, and what it leaves alone. The images themselves are judged in
/// tests/avatar/render_integration_test.cc.
namespace mvstudio {
namespace {

namespace fs = std::filesystem;

class AvatarRender : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new testing::TempDir();
    avatar::WriteMannequinDataset(*folder_ / "data", 4, 8, 96);
    const CliRun run = RunCli({"avatar",
                               "train",
                               *folder_ / "data",
                               "--out",
                               path("run"),
                               "--size",
                               "32",
                               "--width",
                               "4",
                               "--downs",
                               "2",
                               "--encoder-blocks",
                               "1",
                               "--decoder-blocks",
                               "1",
                               "--no-fit-shape",
                               "--steps",
                               "0",
                               "--holdout-cameras",
                               "00_03",
                               "--holdout-frames",
                               "6-7"});
    ASSERT_EQ(run.exit, 0) << run.err;
  }
  static void TearDownTestSuite() { delete folder_; }
  static std::string path(const std::string& name) { return *folder_ / name; }
  static CliRun Render(std::vector<std::string> words) {
    words.insert(words.begin(), {"avatar", "render", path("run"), "--json"});
    return RunCli(words);
  }
  static size_t CountFiles(const std::string& folder) {
    size_t count = 0;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      count += entry.is_regular_file() && entry.path().filename() != ".mvstudio.json";
    return count;
  }

  static testing::TempDir* folder_;
};
testing::TempDir* AvatarRender::folder_ = nullptr;

TEST_F(AvatarRender, HeldOutImagesUnlessToldOtherwise) {
  for (int twice = 0; twice < 2; ++twice) {  // its own folder is replaced
    const CliRun run = Render({"--overwrite"});
    ASSERT_EQ(run.exit, 0) << run.out << run.err;
    const auto metrics = run.Json()["metrics"];
    EXPECT_EQ(metrics["pictures"], 2);
    EXPECT_EQ(metrics["views"], nlohmann::json({"00_03"}));
    EXPECT_EQ(metrics["size_px"], 32);
  }
  EXPECT_EQ(testing::Slurp(path("run/render/00_03/00_03_00000006.png"))[25], 6) << "PNG colour type: RGB with opacity";
  const CliRun some = Render({"--cameras", "00_00,00_01", "--frames", "0-5", "--every", "2", "--background", "#ff8000",
                              "--size", "40", "--out", path("some")});
  ASSERT_EQ(some.exit, 0) << some.err;
  EXPECT_EQ(some.Json()["metrics"]["pictures"], 6);
  const Image image = dataset::ReadImage(path("some/00_01/00_01_00000004.png"));
  ASSERT_EQ(image.width, 40);
  ASSERT_EQ(image.channels, 3);
  EXPECT_NEAR(image.pixels[0], 255, 1);
  EXPECT_NEAR(image.pixels[1], 128, 1);
  EXPECT_NEAR(image.pixels[2], 0, 1);
}

TEST_F(AvatarRender, VideosOnePerCameraAndATurningOne) {
  const CliRun both = Render({"--cameras", "00_00,00_01", "--frames", "0-3", "--video", path("v/take.mp4"), "--fps", "10"});
  ASSERT_EQ(both.exit, 0) << both.err;
  EXPECT_EQ(both.Json()["metrics"]["rate_hz"], 10);
  EXPECT_TRUE(fs::exists(path("v/take_00_00.mp4")));
  EXPECT_TRUE(fs::exists(path("v/take_00_01.mp4")));
  EXPECT_EQ(CountFiles(path("v")), 2u) << "and no pictures";
  const std::string before = testing::Slurp(path("v/take_00_00.mp4"));
  const CliRun refused = Render({"--cameras", "00_00,00_01", "--video", path("v/take.mp4")});
  EXPECT_EQ(refused.exit, 2);
  EXPECT_THAT(refused.out, HasSubstr("--overwrite"));
  EXPECT_EQ(testing::Slurp(path("v/take_00_00.mp4")), before);
  const CliRun turn = Render({"--turntable", "5", "--frames", "6", "--video", path("turn.mp4"), "--out", path("turn")});
  ASSERT_EQ(turn.exit, 0) << turn.err;
  EXPECT_EQ(turn.Json()["metrics"]["pictures"], 5);
  EXPECT_EQ(CountFiles(path("turn")), 5u);
  EXPECT_TRUE(fs::exists(path("turn.mp4")));
}

TEST_F(AvatarRender, WhatCannotBeDoneLosesNothing) {
  MakeFolder(path("full"));
  WriteFileAtomic(path("full/mine.txt"), "mine");
  const std::vector<std::pair<std::vector<std::string>, int>> refused = {
      {{"--out", path("full")}, 2},
      {{"--video", path("x.avi")}, 2},
      {{"--fps", "-1"}, 2},
      {{"--cameras", "nobody"}, 2},
      {{"--frames", "500"}, 4},
      {{"--background", path("none.png")}, 2},
      {{"--bvh", path("none.bvh")}, 3},
      {{"--poses", path("none")}, 3},
      {{"--calib", path("full/mine.txt")}, 3},
      {{"--bvh", path("none.bvh"), "--poses", path("none")}, 2},
  };
  for (const auto& [words, exit] : refused) {
    const CliRun run = Render(words);
    EXPECT_EQ(run.exit, exit) << words[0] << " " << words[1] << ": " << run.out;
    EXPECT_EQ(run.Json()["errors"].size(), 1u);
  }
  EXPECT_EQ(testing::Slurp(path("full/mine.txt")), "mine");
  EXPECT_EQ(CountFiles(path("full")), 1u);
  EXPECT_EQ(RunCli({"avatar", "render", path("nowhere")}).exit, 3);
}

}  // namespace
}  // namespace mvstudio
