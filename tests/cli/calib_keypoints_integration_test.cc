#include <filesystem>

#include "calib/calibrate.h"
#include "core/units.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

/// `calib refine --from-keypoints` as a user runs it.
namespace mvstudio::testing {
namespace {

using Words = std::vector<std::string>;

Words Refine(const std::string& out) {
  const std::string p = DataRoot() + "/pose2sim";
  Words words = {"calib",      "refine", "--from-keypoints", "--calib", p + "/calibration/Calib_qualisys.toml",
                 "--skeleton", "body25b"};
  for (const std::string n : {"01", "02", "03", "04"})
    words.insert(words.end(), {"--pose2d", "cam_" + n + "=" + p + "/balancing/pose-associated/cam" + n + "_json"});
  words.insert(words.end(), {"--out", out, "--json"});
  return words;
}

Words operator+(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST(CalibKeypoints, RefinesARealRigFromPeople) {
  MVS_NEEDS_DATA("pose2sim");
  const TempDir folder;
  const CliRun run = RunCli(Refine(folder / "run") + Words{"--train-frames", "0:4", "--test-frames", "2:4"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const auto metrics = run.Json()["metrics"];
  EXPECT_NEAR(metrics["holdout_median_px"]["before"].get<double>(), 6.69, 0.1);
  EXPECT_LE(metrics["holdout_median_px"]["after"].get<double>(), 3.97);
  EXPECT_LT(metrics["holdout_mean_px"]["after"].get<double>(), 8.84);
  EXPECT_LE(metrics["limb_std_mm"]["after"].get<double>(), 19.6);
  ASSERT_EQ(metrics["cameras"].size(), 4u);
  for (const auto& camera : metrics["cameras"]) {
    EXPECT_GT(camera["rotation_deg"].get<double>(), 0.3);
    EXPECT_LT(camera["rotation_deg"].get<double>(), 1.5);
    EXPECT_LT(camera["translation_mm"].get<double>(), 100);
    EXPECT_EQ(camera["mean_residual_px"]["before"].size(), 2u);
    EXPECT_EQ(camera["distortion"], "keep");
  }
  int chosen = 0;
  for (const auto& decision : metrics["decisions"]) chosen += decision["chosen"].get<bool>();
  EXPECT_EQ(chosen, 5);  // one of each group
  const geometry::Rig rig = geometry::ReadRig(folder / "run/calibration.json");
  ASSERT_EQ(rig.cameras.size(), 4u);
  EXPECT_TRUE(rig.cameras[2].cam_from_world_covariance);
  EXPECT_FALSE(GaugeText(rig.gauge).empty());
}

/// Only the lenses are known: the person places the cameras better than the lab's calibration does (6.6 px).
TEST(CalibKeypoints, APersonPlacesCamerasOfKnownLenses) {
  MVS_NEEDS_DATA("pose2sim");
  const TempDir folder;
  const std::string lab = DataRoot() + "/pose2sim/calibration/Calib_qualisys.toml", lenses = folder / "lenses.json";
  ASSERT_EQ(RunCli({"calib", "convert", lab, "--to", "mvstudio", "--out", folder / "lab.json"}).exit, 0);
  const geometry::Rig truth = geometry::ReadRig(folder / "lab.json");
  geometry::Rig rig = truth;
  for (geometry::RigCamera& camera : rig.cameras) camera.cam_from_world = {};
  rig.gauge = calib::kLensesOnly;
  geometry::WriteRig(rig, lenses);
  Words words = Refine(folder / "run");
  words[4] = lenses;
  const CliRun run = RunCli(words);
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_THAT(run.out, HasSubstr("CAL-SCALE"));
  EXPECT_LT(run.Json()["metrics"]["holdout_median_px"]["after"].get<double>(), 6);
  const geometry::Rig placed = geometry::ReadRig(folder / "run/calibration.json");
  ASSERT_EQ(placed.cameras.size(), 4u);
  const auto first_from = [](const geometry::Rig& r, size_t c) {
    return r.cameras[0].cam_from_world * geometry::Inverse(r.cameras[c].cam_from_world);
  };
  // The lab's rig is itself off by degrees beside the first camera, and the height is assumed.
  for (size_t c = 1; c < 4; ++c) {
    const geometry::Rigid3 found = first_from(placed, c), wanted = first_from(truth, c);
    EXPECT_LT(RadToDeg(geometry::RotationAngle(found.rotation, wanted.rotation)), 8) << c;
    EXPECT_NEAR(found.translation.norm() / wanted.translation.norm(), 1, 0.2) << c;
  }
}

/// A wand of two balls, lenses that another program wrote with poses at the origin: the wand places the cameras, and its length
/// is the rig's scale. Commands that need poses refuse such lenses.
TEST(CalibKeypoints, AWandPlacesCamerasOfKnownLenses) {
  MVS_NEEDS_DATA("reports");
  const TempDir folder;
  const std::string p = DataRoot() + "/reports/calib/32_";
  const Words input = {"--calib", p + "lenses.json", "--points2d", p + "wand.csv", "--skeleton", p + "wand.toml"};
  const CliRun run = RunCli(Words{"calib", "refine", "--from-keypoints"} + input + Words{"--out", folder / "run", "--json"});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  EXPECT_NEAR(run.Json()["metrics"]["limb_mean_mm"]["after"].get<double>(), 500, 1);
  EXPECT_THAT(run.out, Not(HasSubstr("TRI-DUPLICATE")));
  const CliRun refused = RunCli(Words{"triangulate"} + input + Words{"--out", folder / "pose3d"});
  EXPECT_EQ(refused.exit, 3) << refused.out;
  EXPECT_THAT(refused.err + refused.out, HasSubstr("holds lenses only"));
}

TEST(CalibKeypoints, MistakesAreNamed) {
  MVS_NEEDS_DATA("pose2sim");
  const TempDir folder;
  CliRun run = RunCli(Refine(folder / "run") + Words{"--train-frames", "zero"});
  EXPECT_EQ(run.exit, 2);
  EXPECT_THAT(run.out, HasSubstr("START:STEP"));
  run = RunCli(Refine(folder / "run") + Words{"--train-frames", "0:2", "--test-frames", "0:4"});
  EXPECT_EQ(run.exit, 2);
  EXPECT_THAT(run.out, HasSubstr("share frame"));
}

/// Two train frames carry nothing: exit 5, one line, no rig.
TEST(CalibKeypoints, TooLittleIsIllPosed) {
  MVS_NEEDS_DATA("pose2sim");
  const TempDir folder;
  const CliRun run = RunCli(Refine(folder / "run") + Words{"--train-frames", "0:60"});
  EXPECT_EQ(run.exit, 5) << run.out;
  EXPECT_EQ(run.Json()["metrics"]["status"], "TooFewViews");
  EXPECT_FALSE(std::filesystem::exists(folder / "run/calibration.json"));
}

/// Two cameras under each other's name. The adjustment cannot turn one into the other: exit 4 or 5, never a plain success.
TEST(CalibKeypoints, ALostTakeNamesItsCause) {
  MVS_NEEDS_DATA("pose2sim");
  const TempDir folder;
  Words words = Refine(folder / "run");
  for (std::string& word : words) {
    if (word.rfind("cam_01=", 0) == 0) {
      word.replace(0, 6, "cam_03");
    } else if (word.rfind("cam_03=", 0) == 0) {
      word.replace(0, 6, "cam_01");
    }
  }
  const CliRun run = RunCli(words + Words{"--keypoint-frames", "12", "--keypoint-folds", "2", "--no-keypoint-lenses"});
  EXPECT_TRUE(run.exit == 4 || run.exit == 5) << run.out;
  EXPECT_THAT(run.out, HasSubstr("CAL-CAUSE"));
  EXPECT_THAT(run.out, HasSubstr("the detections of cam_01 and cam_03 exchanged"));
}

}  // namespace
}  // namespace mvstudio::testing
