#include "tests/support/run_cli.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::testing {
namespace {

using Json = nlohmann::json;
using Words = std::vector<std::string>;

Json RunJson(Words words, int exit = 0) {
  words.push_back("--json");
  const CliRun run = RunCli(words);
  EXPECT_EQ(run.exit, exit) << words[0] << ": " << run.err;
  const Json json = run.Json();
  EXPECT_TRUE(json.is_object()) << run.out;
  return json.is_object() ? json : Json::object();
}

bool HasWarningAbout(const Json& result, const std::string& text) {
  for (const Json& warning : result["warnings"]) {
    if (warning["text"].get<std::string>().find(text) != std::string::npos) return true;
  }
  return false;
}

/// Scores of a run against its two plain baselines.
void ExpectBetterThanBaselines(const Json& eval) {
  const Json& metrics = eval["metrics"];
  for (const char* baseline : {"mean_image", "nearest_pose"}) {
    EXPECT_GT(metrics["holdout"]["ssim"].get<double>(), metrics["baselines"][baseline]["ssim"].get<double>()) << baseline;
    EXPECT_GT(metrics["holdout"]["psnr_db"].get<double>(), metrics["baselines"][baseline]["psnr_db"].get<double>()) << baseline;
  }
}

// The commands of docs/tour-real-session.md, with a shorter training.
TEST(RealSession, FourCamerasFromVideosToReport) {
  MVS_NEEDS_DATA("pose2sim");
  TempDir run;
  const std::string p = DataRoot() + "/pose2sim";
  RunJson({"calib", "convert", p + "/calibration/Calib_qualisys.toml", "--to", "mvstudio", "--out", run / "calibration.json"});

  Words triangulate = {"triangulate",  "--calib", run / "calibration.json",
                       "--skeleton",   "body25b", "--out",
                       run / "pose3d", "--trc",   p + "/balancing/pose-3d/S00_P00_T01_BalancingTrial_0-100.trc"};
  Words build = {"dataset", "build", "--calib", run / "calibration.json", "--pose3d", run / "pose3d", "--out", run / "dataset"};
  for (const std::string n : {"01", "02", "03", "04"}) {
    triangulate.insert(triangulate.end(), {"--pose2d", "cam_" + n + "=" + p + "/balancing/pose-associated/cam" + n + "_json"});
    build.insert(build.end(), {"--video", "cam_" + n + "=" + p + "/balancing/videos/cam" + n + ".mp4"});
  }
  const Json points = RunJson(triangulate);
  EXPECT_LE(points["metrics"]["trc"]["median_mm"].get<double>(), 10);
  EXPECT_LE(points["metrics"]["median_rms_px"].get<double>(), 15);  // Pose2Sim's own points have 10.65, on fewer views
  EXPECT_TRUE(HasWarningAbout(points, "cam_03"));                   // the lab's calibration is off by several px there

  const Json dataset = RunJson(build);
  EXPECT_TRUE(HasWarningAbout(dataset, "1080"));
  RunJson({"dataset", "verify", run / "dataset"});
  RunJson({"avatar", "train", run / "dataset", "--method", "tna", "--holdout-cameras", "cam_02", "--holdout-frames", "80-99",
           "--size", "64", "--steps", "150", "--out", run / "avatar"});
  const Json eval = RunJson({"avatar", "eval", run / "avatar"});
  EXPECT_GT(eval["metrics"]["holdout"]["mask_iou"].get<double>(), 0.5);
  RunJson({"report", run.path(), "--out", run / "report.html"});
  EXPECT_GT(std::filesystem::file_size(run / "report.html"), 50000u);
}

// A dataset that none of our code wrote.
TEST(PersonA, VerifiesTriangulatesTrainsAndScores) {
  MVS_NEEDS_DATA("person_a");
  TempDir run;
  const std::string p = DataRoot() + "/person_a";
  RunJson({"dataset", "verify", p});
  Words triangulate = {"triangulate",  "--calib", p + "/calibration_person_a.json", "--skeleton", "body25", "--out",
                       run / "pose3d", "--truth", p + "/hdPose3d_stage1_coco19"};
  for (int i = 0; i < 10; ++i) {
    const std::string camera = "00_0" + std::to_string(i);
    triangulate.insert(triangulate.end(), {"--pose2d", camera + "=" + p + "/pose2d/" + camera});
  }
  const Json points = RunJson(triangulate);
  EXPECT_LT(points["metrics"]["truth"]["median_mm"].get<double>(), 5.5);
  RunJson({"avatar", "train", p, "--method", "tna", "--holdout-cameras", "00_03,00_08", "--holdout-frames", "90-119", "--size",
           "64", "--steps", "200", "--out", run / "avatar"});
  ExpectBetterThanBaselines(RunJson({"avatar", "eval", run / "avatar"}));
}

TEST(Stereo, ChessboardPairsGiveTheKnownBaseline) {
  MVS_NEEDS_DATA("opencv_stereo");
  TempDir run;
  const std::string p = DataRoot() + "/opencv_stereo";
  const Json result = RunJson({"calibrate", "--board", "chessboard:9x6:25mm", "--camera", "left=" + p + "/left*.jpg",
                               "--camera", "right=" + p + "/right*.jpg", "--out", run.path()});
  EXPECT_LE(result["metrics"]["rms_px"].get<double>(), 0.257);
  EXPECT_GE(result["metrics"]["baseline_mm"].get<double>(), 82.8);
  EXPECT_LE(result["metrics"]["baseline_mm"].get<double>(), 83.3);
}

}  // namespace
}  // namespace mvstudio::testing
