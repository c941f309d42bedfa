#include <filesystem>

#include "core/format.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/image_io.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

// Key points of the installed nets on recordings, triangulated and compared with what is known of them.
#define MVS_NEEDS_NETS()                                                     \
  if (::mvstudio::testing::RunCli({"models", "list"}).exit != 0) {           \
    GTEST_SKIP() << "needs the nets' weights (run `mvstudio models fetch`)"; \
  }

namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Words = std::vector<std::string>;

Json RunJson(Words words) {
  words.push_back("--json");
  const CliRun run = RunCli(words);
  EXPECT_EQ(run.exit, 0) << words[0] << ": " << run.err;
  const Json json = run.Json();
  EXPECT_TRUE(json.is_object()) << run.out;
  return json.is_object() ? json : Json::object();
}

struct Figures {
  double median_mm = 1e9;
  double share = 0;  // of the joints tried that were triangulated
};

/// Footage (CAMERA=FOLDER) -> key points -> 3D joints, compared with `reference` (option and path).
Figures Score(const TempDir& folder, const std::vector<std::string>& cameras, const std::string& calibration,
              const std::string& backend, const std::string& quality, const Words& reference) {
  const std::string out = folder / ("pose2d_" + backend);
  Words detect = {"pose2d", "--backend", backend, "--quality", quality, "--out", out};
  const std::string skeleton = backend == "blazepose" ? "mediapipe33" : "coco17";
  Words triangulate = {"triangulate", "--calib", calibration, "--skeleton", skeleton, "--out", folder / ("pose3d_" + backend)};
  for (const std::string& camera : cameras) {
    detect.insert(detect.end(), {"--images", camera + "=" + (folder / camera)});
    triangulate.insert(triangulate.end(), {"--pose2d", camera + "=" + out + "/" + camera});
  }
  RunJson(detect);
  triangulate.insert(triangulate.end(), reference.begin(), reference.end());
  const Json metrics = RunJson(triangulate)["metrics"];
  const char* key = reference[0] == "--trc" ? "trc" : "truth";
  const Figures figures{metrics[key]["median_mm"],
                        metrics["num_points"].get<double>() / metrics["num_joints_tried"].get<double>()};
  std::printf("%s %s: median %.1f mm, %.1f %% of the joints\n", backend.c_str(), quality.c_str(), figures.median_mm,
              100 * figures.share);
  return figures;
}

/// Every `step`-th frame as an image that keeps its number.
void WriteFrames(const std::string& video, const std::string& folder, int step) {
  const auto source = dataset::OpenFrames(video);
  while (const auto frame = source->Next()) {
    if (frame->frame_idx % step != 0) continue;
    dataset::WriteImage(frame->rgb, folder + Format("/%08d.jpg", static_cast<int>(frame->frame_idx)), 95);
  }
}

// Four cameras, one of them with a bystander, three of them rolled; the reference is another program's triangulation.
TEST(Pose2dOfRecordings, BalancingFromVideoOnly) {
  MVS_NEEDS_DATA("pose2sim");
  MVS_NEEDS_NETS();
  TempDir folder;
  const std::string p = DataRoot() + "/pose2sim", calibration = folder / "calibration.json";
  RunJson({"calib", "convert", p + "/calibration/Calib_qualisys.toml", "--to", "mvstudio", "--out", calibration});
  std::vector<std::string> cameras;
  for (const std::string n : {"01", "02", "03", "04"}) {
    cameras.push_back("cam_" + n);
    WriteFrames(p + "/balancing/videos/cam" + n + ".mp4", folder / cameras.back(), 5);
  }
  const Words reference = {"--trc", p + "/balancing/pose-3d/S00_P00_T01_BalancingTrial_0-100.trc"};
  const Figures posenet = Score(folder, cameras, calibration, "posenet", "balanced", reference);
  EXPECT_LT(posenet.median_mm, 75);
  EXPECT_GT(posenet.share, 0.65);
  const Figures movenet = Score(folder, cameras, calibration, "movenet", "fast", reference);
  EXPECT_LT(movenet.median_mm, 45);
  EXPECT_GT(movenet.share, 0.97);
  const Figures blazepose = Score(folder, cameras, calibration, "blazepose", "balanced", reference);  // with feet
  EXPECT_LT(blazepose.median_mm, 50);
  EXPECT_GT(blazepose.share, 0.97);
}

// Ten cameras around a rendered person whose joints are known exactly.
TEST(Pose2dOfRecordings, PersonAAgainstExactJoints) {
  MVS_NEEDS_DATA("person_a");
  MVS_NEEDS_NETS();
  TempDir folder;
  const std::string p = DataRoot() + "/person_a";
  std::vector<std::string> cameras;
  for (int c = 0; c < 10; ++c) {
    cameras.push_back("00_0" + std::to_string(c));
    fs::create_directories(folder / cameras.back());
    for (int f = 48; f < 78; f += 3) {
      const std::string name = cameras.back() + "_000000" + std::to_string(f) + ".jpg";
      fs::create_symlink(fs::absolute(p) / "hdImgs" / cameras.back() / name, folder / (cameras.back() + "/" + name));
    }
  }
  const Words reference = {"--truth", p + "/hdPose3d_stage1_coco19"};
  const Figures posenet = Score(folder, cameras, p + "/calibration_person_a.json", "posenet", "fast", reference);
  EXPECT_LT(posenet.median_mm, 40);
  EXPECT_GT(posenet.share, 0.95);
  const Figures movenet = Score(folder, cameras, p + "/calibration_person_a.json", "movenet", "fast", reference);
  EXPECT_LT(movenet.median_mm, 21);
  EXPECT_GT(movenet.share, 0.99);
  const Figures blazepose = Score(folder, cameras, p + "/calibration_person_a.json", "blazepose", "balanced", reference);
  EXPECT_LT(blazepose.median_mm, 40);
  EXPECT_GT(blazepose.share, 0.9);
}

}  // namespace
}  // namespace mvstudio::testing
