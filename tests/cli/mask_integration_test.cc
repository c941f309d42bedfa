#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/format.h"
#include "core/random.h"
#include "dataset/footage/image_io.h"
#include "tests/detect/tiny_onnx.h"
#include "tests/support/run_cli.h"
#include "tests/support/temp_dir.h"

namespace mvstudio {
namespace {

using testing::CliRun;
using testing::RunCli;

/// A disk that walks over a striped wall; also its exact masks.
struct Footage {
  testing::TempDir folder;
  std::string images() const { return folder.path() + "/images"; }
  std::string truth() const { return folder.path() + "/truth"; }

  explicit Footage(double step_px, int count = 8) {
    Rng rng(5);
    for (int f = 0; f < count; ++f) {
      Image rgb(160, 120, 3), mask(160, 120, 1, 0);
      for (int y = 0; y < 120; ++y) {
        for (int x = 0; x < 160; ++x) {
          const bool in = std::hypot(x - 24 - step_px * f, y - 60) < 22;
          *mask.Pixel(x, y) = in ? 255 : 0;
          for (int k = 0; k < 3; ++k)
            rgb.Pixel(x, y)[k] = uint8_t((in ? (k == 0 ? 200 : 50) : ((x / 10) % 2 ? 150 : 110)) + rng.Index(4));
        }
      }
      const std::string name = Format("/%04d.png", f);
      dataset::WriteImage(rgb, images() + name);
      dataset::WriteImage(mask, truth() + name);
    }
  }
};

TEST(MaskCommand, BackgroundFromMotionAlone) {
  const Footage footage(16);
  const std::string out = footage.folder.path() + "/masks";
  const CliRun run = RunCli({"mask", "--images", "A=" + footage.images(), "--truth", "A=" + footage.truth(), "--backend",
                             "background", "--soft", "--out", out, "--json"});
  ASSERT_EQ(run.exit, 0) << run.err << run.out;
  const auto json = run.Json();
  EXPECT_EQ(json["metrics"]["backend"], "background");
  EXPECT_EQ(json["metrics"]["pictures"], 8);
  EXPECT_GT(json["metrics"]["truth"]["mean_iou"].get<double>(), 0.95);
  EXPECT_LT(json["metrics"]["flicker"].get<double>(), 1e-3);
  const Image mask = dataset::ReadImage(out + "/A/00000003.png", true);
  EXPECT_EQ(*mask.Pixel(80, 60), 255);
  EXPECT_EQ(*mask.Pixel(5, 5), 0);
  EXPECT_TRUE(std::filesystem::exists(out + "/soft/A/00000003.png"));
  EXPECT_TRUE(std::filesystem::exists(out + "/A.sheet.jpg"));
  EXPECT_TRUE(std::filesystem::exists(out + "/mask.result.json"));
}

TEST(MaskCommand, NobodyMovesAndNothingElseTells) {
  const Footage footage(0);
  const std::string out = footage.folder.path() + "/masks";
  const CliRun run = RunCli({"mask", "--images", "A=" + footage.images(), "--backend", "background", "--out", out, "--json"});
  EXPECT_EQ(run.exit, 5);
  EXPECT_EQ(run.Json()["errors"][0]["code"], "MSK-NOBODY");
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST(MaskCommand, ANetOfOnesOwn) {
  const Footage footage(0);  // nothing moves: the net alone knows who is the person
  const std::string out = footage.folder.path() + "/masks", net = footage.folder.path() + "/net.onnx";
  testing::WriteOnnx(net, 1, {12, 0, -12}, {-3});
  const std::vector<std::string> words = {"mask",
                                          "--images",
                                          "A=" + footage.images(),
                                          "--truth",
                                          "A=" + footage.truth(),
                                          "--backend",
                                          "onnx:" + net,
                                          "--onnx-width",
                                          "32",
                                          "--onnx-height",
                                          "32",
                                          "--out",
                                          out,
                                          "--json"};
  const CliRun run = RunCli(words);
  ASSERT_EQ(run.exit, 0) << run.err << run.out;
  EXPECT_EQ(run.Json()["metrics"]["backend"], "onnx:" + net);
  EXPECT_GT(run.Json()["metrics"]["truth"]["mean_iou"].get<double>(), 0.9);
  std::filesystem::remove_all(out);
  std::ofstream(net) << "no net";
  const CliRun broken = RunCli(words);
  EXPECT_EQ(broken.exit, 3) << broken.err;
  EXPECT_NE(broken.err.find(net), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST(MaskCommand, DamagedAndOddImagesAreNamed) {
  const Footage footage(10, 6);
  const std::string out = footage.folder.path() + "/masks", file = footage.images() + "/0004.png";
  const std::vector<std::string> words = {"mask", "--images", "A=" + footage.images(), "--backend", "background", "--out", out};
  dataset::WriteImage(Image(80, 60, 3, 9), file);
  const CliRun size = RunCli(words);
  EXPECT_EQ(size.exit, 3);
  EXPECT_NE(size.err.find("0004.png"), std::string::npos) << size.err;
  EXPECT_NE(size.err.find("80x60"), std::string::npos) << size.err;
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  const CliRun cut = RunCli(words);
  EXPECT_EQ(cut.exit, 3);
  EXPECT_NE(cut.err.find("0004.png"), std::string::npos) << cut.err;
  EXPECT_FALSE(std::filesystem::exists(out));
  std::vector<std::string> kept = words;
  kept.push_back("--keep-undamaged");
  const CliRun rest = RunCli(kept);
  EXPECT_EQ(rest.exit, 6) << rest.err;
  EXPECT_NE(rest.err.find("MSK-FRAMES: camera A: "), std::string::npos) << rest.err;
  EXPECT_FALSE(std::filesystem::exists(out + "/A/00000004.png"));
  EXPECT_TRUE(std::filesystem::exists(out + "/A/00000005.png"));
}

TEST(MaskCommand, FramesWithNobodyAreEmptyAndSaid) {
  const Footage footage(16);
  Image wall = dataset::ReadImage(footage.images() + "/0000.png");
  for (int y = 0; y < wall.height; ++y) {
    for (int x = 0; x < 80; ++x) std::copy_n(wall.Pixel(x % 20 + 100, y), 3, wall.Pixel(x, y));
  }
  dataset::WriteImage(wall, footage.images() + "/0008.png");
  const std::string out = footage.folder.path() + "/masks";
  const CliRun run = RunCli({"mask", "--images", "A=" + footage.images(), "--backend", "background", "--out", out, "--json"});
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.Json()["metrics"]["per_camera"][0]["empty"], 1);
  EXPECT_EQ(run.Json()["warnings"][0]["code"], "MSK-EMPTY");
  const Image mask = dataset::ReadImage(out + "/A/00000008.png", true);
  EXPECT_EQ(std::count(mask.pixels.begin(), mask.pixels.end(), 255), 0);
}

TEST(MaskCommand, WrongArgumentsAreNamed) {
  const Footage footage(10, 2);
  const std::string out = footage.folder.path() + "/masks", camera = "A=" + footage.images();
  EXPECT_EQ(RunCli({"mask", "--out", out}).exit, 2);
  EXPECT_EQ(RunCli({"mask", "--images", camera, "--backend", "magic", "--out", out}).exit, 2);
  EXPECT_EQ(RunCli({"mask", "--images", camera, "--pose3d", "x", "--out", out}).exit, 2);
  EXPECT_EQ(RunCli({"mask", "--images", camera, "--hull", "--out", out}).exit, 2);
  EXPECT_EQ(RunCli({"mask", "--images", "A=/nowhere", "--backend", "background", "--out", out}).exit, 3);
  dataset::WriteImage(Image(10, 10, 3), footage.folder.path() + "/plate.png");
  const CliRun plate = RunCli({"mask", "--images", camera, "--plate", "A=" + footage.folder.path() + "/plate.png", "--backend",
                               "background", "--out", out});
  EXPECT_EQ(plate.exit, 3);
  EXPECT_NE(plate.err.find("10x10"), std::string::npos) << plate.err;
  const CliRun missing = RunCli({"mask", "--images", camera, "--backend", "selfie", "--out", out}, "MVSTUDIO_MODELS=/nowhere ");
  EXPECT_EQ(missing.exit, 8);
  EXPECT_FALSE(std::filesystem::exists(out));
}

/// A studio of three small cameras and its truth: what a budget needs.
class MaskBudget : public ::testing::Test {
 protected:
  void SetUp() override {
    const CliRun made = RunCli({"synth", "--out", Path("studio"), "--cameras", "3", "--size", "160x120", "--board-frames", "0",
                                "--take-frames", "20", "--samples", "1"});
    ASSERT_EQ(made.exit, 0) << made.err;
  }
  std::string Path(const std::string& name) const { return folder_.path() + "/" + name; }
  CliRun Run(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> words = {"mask", "--backend", "background", "--out", Path(out), "--json"};
    for (const char* camera : {"cam_01", "cam_02", "cam_03"})
      words.insert(words.end(), {"--video", std::string(camera) + "=" + Path("studio/raw/take1/") + camera + ".mp4"});
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  }
  std::vector<std::string> WithRig(std::vector<std::string> more) const {
    more.insert(more.end(), {"--calib", Path("studio/truth/calibration.json"), "--pose3d", Path("studio/truth/pose3d")});
    return more;
  }

  testing::TempDir folder_;
};

/// What a budget chose gives the masks of the same flags by hand; predictions of both runs stay.
TEST_F(MaskBudget, ChoosesWhatCanBeRepeatedByHand) {
  const CliRun run = Run("out", WithRig({"--budget", "1h"}));
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const nlohmann::json budget = run.Json()["metrics"]["budget"];
  ASSERT_EQ(budget["trials"].size(), 3u) << "coarse, as it is, with the hull";
  EXPECT_EQ(budget["error_unit"], "%");
  const double predicted = budget["predicted_error"], actual = budget["actual_error"];
  EXPECT_NEAR(actual, predicted, 0.3 * predicted);
  EXPECT_NEAR(actual, 100 * run.Json()["metrics"]["disagreement_with_hull"].get<double>(), 1e-9);
  EXPECT_GT(budget["predicted_seconds"], 0);
  EXPECT_EQ(budget["reasons"].size(), 1u + 2u + 3u) << budget["reasons"];
  std::vector<std::string> flags;
  for (const auto& [option, value] : budget["chosen"].items()) {
    flags.push_back("--" + option);
    if (value != "on") flags.push_back(value);
  }
  ASSERT_EQ(Run("hand", WithRig(flags)).exit, 0);
  for (const char* name : {"/cam_01/00000000.png", "/cam_02/00000010.png", "/cam_03/00000019.png"})
    EXPECT_EQ(testing::Slurp(Path(std::string("out") + name)), testing::Slurp(Path(std::string("hand") + name))) << name;
  ASSERT_EQ(Run("out", WithRig({"--target", "90%", "--overwrite"})).exit, 0);
  const std::string kept = testing::Slurp(Path("out/predictions.jsonl"));
  EXPECT_EQ(std::count(kept.begin(), kept.end(), '\n'), 2);
}

TEST_F(MaskBudget, WhatIsGivenStays) {
  const CliRun run = Run("out", WithRig({"--budget", "1h", "--mask-coarse-side", "320", "--hull"}));
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const nlohmann::json budget = run.Json()["metrics"]["budget"];
  EXPECT_EQ(budget["trials"].size(), 1u);
  EXPECT_TRUE(budget["chosen"].empty()) << budget["chosen"];
}

TEST_F(MaskBudget, WhatCannotBeJudgedKeptOrReachedIsSaid) {
  const CliRun blind = Run("out", {"--budget", "1h"});
  EXPECT_EQ(blind.exit, 2);
  EXPECT_THAT(blind.out, ::testing::HasSubstr("--calib"));
  const CliRun length = Run("out", WithRig({"--target", "1px"}));
  EXPECT_EQ(length.exit, 2);
  EXPECT_THAT(length.out, ::testing::HasSubstr("in percent"));
  const CliRun hasty = Run("out", WithRig({"--budget", "1ms"}));
  EXPECT_EQ(hasty.exit, 2);
  EXPECT_THAT(hasty.out, ::testing::HasSubstr("is predicted to take"));
  EXPECT_FALSE(std::filesystem::exists(Path("out")));
  const CliRun bold = Run("out", WithRig({"--target", "0.01%"}));
  EXPECT_EQ(bold.exit, 0) << bold.out;
  EXPECT_THAT(bold.out, ::testing::HasSubstr("BUD-TARGET"));
  EXPECT_THAT(bold.err, ::testing::HasSubstr("is out of reach: the best is"));
}

}  // namespace
}  // namespace mvstudio
