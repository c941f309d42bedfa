#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/mask/describe.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Masks of a take, without the program.
namespace mvstudio::stages {
namespace {

using ::testing::Contains;
using ::testing::Field;

constexpr int kBlockFrames = 12;

std::vector<std::string> MaskCodes(const std::vector<Notice>& notices) {
  std::vector<std::string> codes;
  for (const Notice& notice : notices) codes.push_back(notice.code);
  return codes;
}

std::vector<std::string> MetricNames(const CommandResult& result) {
  std::vector<std::string> names;
  for (const auto& [name, value] : result.metrics.items()) names.push_back(name);
  return names;
}

/// A block of 18 x 40 px that walks over a wall, or the wall alone, and the exact masks.
MaskStageOptions PutBlock(const TempDir& folder, bool walks) {
  for (int frame = 0; frame < kBlockFrames; ++frame) {
    Image rgb(96, 64, 3), mask(96, 64, 1);
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 96; ++x) {
        const bool block = walks && x >= 6 * frame && x < 6 * frame + 18 && y >= 12 && y < 52;
        *mask.Pixel(x, y) = block ? 255 : 0;
        for (int k = 0; k < 3; ++k) rgb.Pixel(x, y)[k] = static_cast<uint8_t>(block ? 220 - 60 * k : 60 + (x * 5 + y * 3) % 40);
      }
    }
    dataset::WriteImage(rgb, folder / ("raw/" + std::to_string(frame) + ".png"));
    dataset::WriteImage(mask, folder / ("truth/" + std::to_string(frame) + ".png"));
  }
  MaskStageOptions options;
  options.take.images = {{"a", folder / "raw"}};
  options.truth = {{"a", folder / "truth"}};
  options.backend = "background", options.out = folder / "out";
  return options;
}

TEST(MaskStage, ABlockThatWalksIsMaskedExactly) {
  const TempDir folder;
  MaskStageOptions options = PutBlock(folder, true);
  const MaskStageReport report = RunMask(options);
  EXPECT_EQ(report.outcome, MaskOutcome::kMade);
  ASSERT_THAT(report.trials, SizeIs(1));
  EXPECT_THAT(report.trials[0].models, IsEmpty());
  EXPECT_EQ(report.masks.cameras[0].take.images, kBlockFrames);
  EXPECT_FALSE(report.AllEmpty());
  ASSERT_THAT(report.truth, SizeIs(1));
  EXPECT_EQ(report.truth[0].images, kBlockFrames);
  EXPECT_EQ(report.truth[0].worst, 1);
  EXPECT_TRUE(std::filesystem::exists(folder / "out/a/00000011.png"));
  EXPECT_TRUE(std::filesystem::exists(folder / "out/a.sheet.jpg"));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_THAT(MetricNames(said),
              ElementsAre("backend", "cameras", "pictures", "mean_area_fraction", "flicker", "ms_per_picture", "hull_instants",
                          "disagreeing_cameras", "per_camera", "truth", "truth_cameras", "wall_s"));
  EXPECT_NEAR(said.metrics["mean_area_fraction"], 18 * 40 / (96.0 * 64), 1e-12);
  EXPECT_EQ(said.metrics["truth"]["worst_picture"], folder / "out/a/00000000.png") << "where it is now, not where it was made";
  ASSERT_THAT(said.outputs, SizeIs(2));
  EXPECT_EQ(said.outputs[0].role, "masks");
  EXPECT_EQ(said.outputs[1].path, folder / "out/a.sheet.jpg");
  EXPECT_EQ(said.folder, folder / "out");
  options.backend = "colour", options.run.overwrite = true;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunMask(options); }), HasSubstr("option 'backend' colour"));
  EXPECT_TRUE(std::filesystem::exists(folder / "out/a/00000011.png")) << "the older output stays";
}

/// Masks before `triangulate` are worse ones, which nobody would notice.
TEST(MaskStage, ASessionWithoutJointsIsSentToTriangulate) {
  const TempDir folder;
  MaskStageOptions options = PutBlock(folder, true);
  std::ofstream(folder / "mvstudio.toml") << R"(schema = "mvstudio.session/1"
units = "m"
fps_hz = 25
cameras = ["a"]
[[takes]]
name = "walk"
[takes.footage]
a = "raw"
)";
  options.take.images.clear(), options.take.session = folder.path(), options.out.clear();
  const CommandResult said = Describe(RunMask(options));
  EXPECT_THAT(MaskCodes(said.warnings), Contains("MSK-NO-JOINTS"));
  EXPECT_THAT(said.warnings,
              Contains(Field(&Notice::hint, HasSubstr("run mvstudio triangulate option 'session' " + folder.path()))));
  EXPECT_TRUE(std::filesystem::exists(folder / "masks/walk/a/00000011.png"));
}

TEST(MaskStage, AWallAloneGivesAReportAndNoFolder) {
  const TempDir folder;
  const MaskStageReport report = RunMask(PutBlock(folder, false));
  EXPECT_EQ(report.outcome, MaskOutcome::kNobody);
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitIllPosed);
  EXPECT_THAT(MaskCodes(said.errors), ElementsAre("MSK-NOBODY"));
  EXPECT_THAT(said.errors[0].text, HasSubstr("camera a: nothing separates people"));
  EXPECT_THAT(MetricNames(said), IsEmpty());
  EXPECT_THAT(said.outputs, IsEmpty());
  EXPECT_THAT(said.folder, IsEmpty());
}

/// Two cameras with ten masks each.
MaskStageReport TwoCameras() {
  MaskStageReport report;
  report.options.out = "masks";
  report.trials = {{"background", Status::kOk, "", 0.02, NAN, {}}, {"selfie", Status::kOk, "", 0.03, NAN, {}}};
  report.cameras = {{"a", {}}, {"b", {}}};
  report.masks.cameras.resize(2);
  for (MaskCameraResult& camera : report.masks.cameras) camera.take.images = 10, camera.background_known = 1;
  return report;
}

TEST(MaskStage, WhatIsDoubtfulIsSaidByCamera) {
  MaskStageReport report = TwoCameras();
  report.cameras[1].damage = {"frame 7 is missing"};
  report.masks.cameras[0].take.empty = 2;
  report.masks.cameras[0].background_known = 0.5;
  report.masks.cameras[0].take.joints = 100, report.masks.cameras[0].take.joints_supported = 50;
  report.options.pose3d = "points", report.pose_frames.emplace(3, 8);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitPartial);
  EXPECT_THAT(MaskCodes(said.warnings),
              ElementsAre("MSK-EMPTY", "MSK-BACKGROUND", "MSK-JOINTS", "MSK-FRAMES", "MSK-NO-JOINTS"));
  EXPECT_THAT(said.warnings[4].text, HasSubstr("no joint of option 'pose3d' lies in an image of b"));
  EXPECT_THAT(said.text, HasSubstr("backend background: background disagrees with the visual hull by 2.0 %; selfie"));
  EXPECT_EQ(said.metrics["trials"].size(), 2u);
}

/// The two halves of the disagreement, of which one alone should be near 0.
TEST(MaskStage, TheHullSaysWhichWayMasksDisagree) {
  MaskStageReport report = TwoCameras();
  report.masks.hull.time_steps = 2;
  report.masks.hull.sums = {{200, 0.02, 0.30, 0}, {200, 0.04, 0.10, 0}};
  const CommandResult said = Describe(report);
  EXPECT_THAT(said.text, HasSubstr("hull: 1.5 % of the masks outside it (best: 0 %), 10.0 % of it in no mask"));
  EXPECT_NEAR(said.metrics["disagreement_with_hull"], 0.115, 1e-12);
}

TEST(MaskStage, MasksOfNobodyFailTheGate) {
  MaskStageReport report = TwoCameras();
  for (MaskCameraResult& camera : report.masks.cameras) camera.take.empty = 10;
  report.options.pose3d = "points", report.pose_frames.emplace(3, 8);
  report.options.truth = {{"a", "exact"}}, report.truth.resize(1);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitQualityGate);
  EXPECT_THAT(MaskCodes(said.errors), ElementsAre("MSK-NOBODY", "MSK-NO-JOINTS", "MSK-TRUTH"));
  EXPECT_THAT(said.errors[1].text, HasSubstr("(joints are of frames 3 to 8)"));
  EXPECT_THAT(MaskCodes(said.warnings), ElementsAre("MSK-EMPTY", "MSK-EMPTY", "MSK-TRUTH"));
  EXPECT_FALSE(said.metrics.contains("truth"));
}

}  // namespace
}  // namespace mvstudio::stages
