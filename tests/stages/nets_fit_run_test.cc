#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "report/page/player.h"
#include "stages/nets/fit/describe.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

std::vector<std::string> RolesOf(const CommandResult& result) {
  std::vector<std::string> roles;
  for (const CommandResult::Output& output : result.outputs) roles.push_back(output.role);
  return roles;
}

std::vector<std::string> CodesOfWarnings(const CommandResult& result) {
  std::vector<std::string> codes;
  for (const Notice& notice : result.warnings) codes.push_back(notice.code);
  return codes;
}

TEST(AvatarFitStage, TheMannequinLiesOnItsOwnSilhouettes) {
  const TempDir folder;
  avatar::WriteMannequinDataset(folder / "data", 4, 4, 96);
  AvatarFitOptions options;
  options.dataset = folder / "data", options.out = folder / "body";
  options.split.holdout_cameras = "00_03", options.split.frames = "0-9";
  options.person.fit_surface = false, options.person.texture_px = 8;
  const AvatarFitReport report = RunAvatarFit(options);
  const body::TexturedPerson kept = body::ReadPerson(folder / "body/body.npz");
  EXPECT_EQ(kept.frames, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_THAT(kept.cameras, SizeIs(3)) << "the held-out one is not looked at";
  ASSERT_THAT(report.fit.fit.cameras, SizeIs(3));
  for (const body::CameraFit& camera : report.fit.fit.cameras) EXPECT_GT(camera.iou, 0.75) << camera.name;
  ASSERT_THAT(report.notes.warnings, SizeIs(1)) << "frames 4 to 9 are not there";
  EXPECT_EQ(report.notes.warnings[0].code, "CLI-FRAMES");
  EXPECT_TRUE(std::filesystem::exists(folder / "body/body.glb"));
  EXPECT_EQ(std::filesystem::exists(folder / "body/surface.png"), report.surface.has_value());
  const std::string motion = ReadFile(folder / "body/body_motion.bin");
  ASSERT_TRUE(report::IsPlayerFile(motion)) << "what the report's studio shows";
  uint32_t counts[4];
  std::memcpy(counts, motion.data() + 8, sizeof counts);
  EXPECT_EQ(counts[0], 0u) << "no Gaussians";
  EXPECT_EQ(counts[2], kept.person.body.vertices.cols());
  EXPECT_EQ(counts[3], kept.person.seen.size());
  EXPECT_EQ(RolesOf(Describe(report))[3], "body-motion");
  EXPECT_THAT(MessageOf<UsageError>([&] { RunAvatarFit(options); }), HasSubstr("option 'overwrite'"));
}

TEST(AvatarFitStage, FilesScalesAndDoubtsAreSaid) {
  AvatarFitReport report;
  report.folder = "body", report.dataset = "data";
  report.fit.fit.cameras = {{"00_00", 20, 0, 0.85, 0.95, {0, 0}, 0.1}};
  report.fit.missing = {"camera 00_00, frame 3"};
  report.doubts = {{"DAT-COVER", "masks: of another take", ""}};
  report.notes.warnings = {{"CLI-FRAMES", "frames 5 to 9", ""}};
  const CommandResult plain = Describe(report);
  EXPECT_THAT(RolesOf(plain), ElementsAre("body", "body-glb", "texture"));
  EXPECT_THAT(plain.inputs, ElementsAre("data"));
  EXPECT_EQ(plain.folder, "body");
  EXPECT_THAT(CodesOfWarnings(plain), ElementsAre("CLI-FRAMES", "BODY-MISSING", "DAT-COVER"));
  EXPECT_FALSE(plain.metrics.contains("surface_maps"));
  report.surface = SurfaceLimits{15, 10};
  const CommandResult mapped = Describe(report);
  EXPECT_THAT(RolesOf(mapped), ElementsAre("body", "body-glb", "texture", "surface-maps"));
  EXPECT_EQ(mapped.metrics["surface_maps"]["offset_limit_mm"], 15);
  report.fit.fit.cameras[0].iou = 0;
  EXPECT_EQ(Describe(report).exit, kExitQualityGate);
}

}  // namespace
}  // namespace mvstudio::stages
