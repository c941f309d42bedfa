#include <cmath>
#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "geometry/rig/rig_io.h"
#include "stages/tradeoff/describe.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

/// Held-out residuals of the lens that filmed are the noise of the corners.
TEST(TradeoffStage, TheLensThatFilmedLeavesTheNoise) {
  calib::testing::SceneOptions scene_options;
  scene_options.noise_px = 0.1, scene_options.num_frames = 16;
  const calib::testing::Scene scene = calib::testing::MakeScene(scene_options);
  const TempDir folder;
  calib::CornerFile file;
  for (const geometry::Camera& camera : scene.truth.cameras) file.cameras.push_back({camera.name, 640, 480});
  file.boards = {scene.board}, file.detections = scene.detections;
  calib::WriteCornerFile(file, folder / "corners.csv");
  CalibrateTradeoffOptions options;
  options.corners.corners = folder / "corners.csv", options.out = folder / "out";
  options.models = {"brown4", "no-lens"}, options.views = {0};
  const CalibrateTradeoffReport report = RunCalibrateTradeoff(options);
  ASSERT_EQ(report.trials.size(), 2u);
  EXPECT_EQ(report.trials[0].detector, "file");
  EXPECT_EQ(report.trials[0].chosen, "brown4");
  EXPECT_NEAR(report.trials[0].holdout_px, 0.1 * std::sqrt(2), 0.05) << "2-D RMS of the noise";
  EXPECT_TRUE(report.trials[0].on_front);
  EXPECT_TRUE(std::isnan(report.trials[1].holdout_px));
  EXPECT_TRUE(std::filesystem::exists(folder / "out/tradeoff-calibrate.html"));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_EQ(said.outputs.at(0).path, folder / "out/tradeoff-calibrate.html");
  EXPECT_TRUE(said.metrics["trials"][1]["holdout_px"].is_null());
  options.views = {-1};
  EXPECT_THAT(MessageOf<UsageError>([&] { RunCalibrateTradeoff(options); }), HasSubstr("option 'views' -1"));
}

TEST(TradeoffStage, AllViewsAndTheirTruthAreCompared) {
  const TempDir folder;
  const geometry::Rig rig = triangulate::MakeRing(4);
  geometry::WriteRig(rig, folder / "calibration.json");
  std::string table = "camera,frame,person,joint,x_px,y_px,score\n";
  Rng rng(3);
  for (const geometry::RigCamera& camera : rig.cameras) {
    for (int f = 0; f < 20; ++f) {
      const auto at = geometry::Project(camera.camera, camera.cam_from_world * Eigen::Vector3d(0.01 * f, 0.1, 0.2));
      table += camera.camera.name + "," + std::to_string(f) + ",0,nose," + std::to_string(at.px.x() + 0.5 * rng.Normal()) +
               "," + std::to_string(at.px.y() + 0.5 * rng.Normal()) + ",0.9\n";
    }
  }
  WriteFileAtomic(folder / "points2d.csv", table);
  TriangulateTradeoffOptions options;
  options.pose.calib = folder / "calibration.json", options.pose.points2d = folder / "points2d.csv";
  options.methods = {triangulate::ByPoint(triangulate::PointMethod::kRobust),
                     triangulate::ByPoint(triangulate::PointMethod::kDlt)};
  options.views = {0, 2}, options.threads = {1};
  const TriangulateTradeoffReport report = RunTriangulateTradeoff(options);
  ASSERT_EQ(report.trials.size(), 6u) << "the DLT has no kernel in float";
  for (const TriangulateTrial& trial : report.trials) EXPECT_EQ(trial.coverage, 1) << trial.Name();
  EXPECT_EQ(report.page, "");
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_EQ(said.metrics["trials"][0]["method"], "robust");
  EXPECT_THAT(said.text, HasSubstr("no other way is both faster and better"));
  options.views = {1};
  EXPECT_THAT(MessageOf<UsageError>([&] { RunTriangulateTradeoff(options); }), HasSubstr("option 'views': a point needs 2"));
  options.methods = {triangulate::TakeMethod()};
  EXPECT_THAT(MessageOf<UsageError>([&] { RunTriangulateTradeoff(options); }), HasSubstr("option 'methods' compares"));
}

TEST(TradeoffStage, WhereNoJointIsSeenTwiceNothingIsCompared) {
  const CommandResult said = Describe(TriangulateTradeoffReport());
  EXPECT_EQ(said.exit, kExitIllPosed);
  EXPECT_EQ(said.errors.at(0).code, "TRI-NO-POINTS");
  TriangulateTradeoffReport report;
  report.options.truth = "truth.trc";
  report.trials.resize(2);
  report.trials[1].why_no_truth = "no frame is in both";
  EXPECT_EQ(Describe(report).exit, kExitQualityGate);
}

}  // namespace
}  // namespace mvstudio::stages
