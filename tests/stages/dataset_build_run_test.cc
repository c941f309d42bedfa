#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "core/format.h"
#include "geometry/rig/rig_io.h"
#include "stages/dataset_build/describe.h"
#include "stages/dataset_build/mask_warnings.h"
#include "stages/dataset_build/run.h"
#include "tests/pack/pack_test_util.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

using ::testing::Contains;

constexpr int kSteps = 4;

const char* BuiltName(int c) { return c == 0 ? "cam_a" : c == 1 ? "cam_b" : "cam_c"; }

/// The grey level of the whole image: each is another one.
uint8_t LevelOf(int c, int frame) { return static_cast<uint8_t>(10 + 60 * c + 20 * frame); }

std::string ImageAt(const TempDir& folder, int c, int frame) {
  return folder / (std::string(BuiltName(c)) + Format("/%04d.png", frame));
}

/// Three cameras around a person who walks for four time steps, 50 of them a second.
DatasetBuildOptions TakeToBuild(const TempDir& folder) {
  DatasetBuildOptions options;
  geometry::Rig rig = dataset::StudioRig(3, 96, 72);
  for (int c = 0; c < 3; ++c) {
    rig.cameras[static_cast<size_t>(c)].camera.name = BuiltName(c);
    std::filesystem::create_directories(folder / BuiltName(c));
    for (int f = 0; f < kSteps; ++f) {
      Image image(96, 72, 3);
      std::fill(image.pixels.begin(), image.pixels.end(), LevelOf(c, f));
      dataset::WriteImage(image, ImageAt(folder, c, f));
    }
    options.take.images.push_back({BuiltName(c), folder / BuiltName(c)});
  }
  geometry::WriteRig(rig, folder / "calibration.json");
  dataset::Pose3d pose;
  pose.skeleton = "coco19", pose.frame_rate_hz = 50;
  for (int f = 0; f < kSteps; ++f) {
    const dataset::Coco19Pose person = dataset::StandingPerson(0.02 * f);
    for (int j = 0; j < 19; ++j) {
      dataset::JointRow row;
      row.frame = f, row.joint = geometry::Coco19().joints[static_cast<size_t>(j)];
      row.status = Status::kOk, row.x_in_world = person.x_in_world.col(j);
      row.num_views = 3, row.sigma_m = 0.001;
      pose.rows.push_back(row);
    }
  }
  dataset::WritePose3d(pose, folder / "pose3d");
  options.calib = folder / "calibration.json", options.pose3d = folder / "pose3d", options.out = folder / "dataset";
  options.no_masks = true, options.build.png = true;
  return options;
}

TEST(DatasetBuildStage, TheFolderHoldsTheTakesImagesAndJoints) {
  const TempDir folder;
  const DatasetBuildReport report = RunDatasetBuild(TakeToBuild(folder));
  EXPECT_EQ(report.built.frames, kSteps);
  EXPECT_EQ(report.built.images, 3 * kSteps);
  EXPECT_FALSE(report.IsPartial());
  EXPECT_FALSE(report.OtherWorld());
  EXPECT_FALSE(report.options.build.masks);
  EXPECT_EQ(report.options.build.frame_rate_hz, 50) << "as the joints state it";

  const dataset::PanopticDataset built = dataset::OpenPanopticDataset(folder / "dataset");
  for (int c = 0; c < 3; ++c) {
    for (int f = 0; f < kSteps; ++f) {
      const Image image = dataset::ReadImage(built.ImagePath(built.Resolve(BuiltName(c)), f));
      EXPECT_EQ(image.pixels.front(), LevelOf(c, f)) << c << " " << f;
    }
  }
  const Eigen::Vector3d joint = built.poses.at(3).at(0).x_in_world.col(5);
  EXPECT_LT((joint - dataset::StandingPerson(0.06).x_in_world.col(5)).norm(), 1e-6);

  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_EQ(said.folder, folder / "dataset");
  EXPECT_EQ(said.metrics["images"], 3 * kSteps);
  EXPECT_EQ(said.metrics["masks_from"], "none");
  EXPECT_FALSE(said.metrics.contains("masks"));
  EXPECT_EQ(said.outputs.at(1).path, folder / "dataset/calibration_take.json");
  EXPECT_THAT(said.inputs, Contains(folder / "calibration.json"));
  EXPECT_THAT(said.inputs, Contains(folder / "pose3d"));
  EXPECT_THAT(said.errors, IsEmpty());
}

TEST(DatasetBuildStage, AnImageThatIsNotThereMakesItPartial) {
  const TempDir folder;
  DatasetBuildOptions options = TakeToBuild(folder);
  options.build.frame_rate_hz = 25, options.keep_rate = true, options.build.keep_undamaged = true;
  std::filesystem::remove(ImageAt(folder, 1, 2));
  const DatasetBuildReport report = RunDatasetBuild(options);
  EXPECT_EQ(report.options.build.frame_rate_hz, 25) << "although the joints state 50";
  EXPECT_EQ(report.built.images, 3 * kSteps - 1);
  ASSERT_EQ(report.built.gaps.size(), 1u);
  EXPECT_EQ(report.built.gaps[0].camera, "cam_b");
  EXPECT_THAT(report.built.gaps[0].time_steps, ElementsAre(2));
  EXPECT_EQ(Describe(report).exit, kExitPartial);
}

TEST(DatasetBuildStage, ATakeWithoutImagesAndAnotherWorldAreReported) {
  DatasetBuildReport report;
  report.options.out = "out";
  report.inputs.calibration = "c.json", report.inputs.pose3d = "p";
  report.built.sequence = "walk", report.built.world = "y up", report.calibrated_world = "right-handed, x up";
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitBadInput);
  ASSERT_EQ(said.errors.size(), 1u);
  EXPECT_EQ(said.errors[0].code, "DAT-INSTANTS");
  ASSERT_EQ(said.warnings.size(), 1u);
  EXPECT_EQ(said.warnings[0].code, "DAT-WORLD");
  EXPECT_EQ(said.warnings[0].text, "p states another world (y up) than c.json (right-handed, x up)");
}

TEST(DatasetBuildStage, WhatMaskSaidOfItsMasksIsRepeated) {
  const TempDir folder;
  EXPECT_THAT(MaskWarnings(folder.path()), IsEmpty());
  Put(folder / "mask.result.json", R"({"warnings": [{"code": "MSK-HULL", "text": "holes", "hint": "look"},
                                                    {"code": "CLI-FRAMES", "text": "beyond"}, 7]})");
  const std::vector<Notice> notices = MaskWarnings(folder.path());
  ASSERT_EQ(notices.size(), 1u);
  EXPECT_EQ(notices[0].code, "MSK-HULL");
  EXPECT_EQ(notices[0].text, "of the masks in " + (folder.path()) + ": holes");
  EXPECT_EQ(notices[0].hint, "look");
}

TEST(DatasetBuildStage, WhatIsMissingIsNamed) {
  EXPECT_THAT(MessageOf<UsageError>([] { RunDatasetBuild({}); }), HasSubstr("no footage: give option 'video'"));
  DatasetBuildOptions options;
  options.take.images = {{"a", "a"}};
  const auto refused = [&] { return MessageOf<UsageError>([&] { RunDatasetBuild(options); }); };
  EXPECT_THAT(refused(), HasSubstr("option 'calib' is needed"));
  options.calib = "calibration.json";
  EXPECT_THAT(refused(), HasSubstr("option 'pose3d' is needed"));
  options.pose3d = "pose3d";
  EXPECT_THAT(refused(), HasSubstr("option 'out' is needed"));
}

/// Every option that is typed is a field of the one list.
/// What a session lacks is made by the command before this one, which the message names.
TEST(DatasetBuildStage, ASessionIsSentToTheStageBefore) {
  const TempDir folder;
  Put(folder / "mvstudio.toml", R"(schema = "mvstudio.session/1"
units = "m"
cameras = ["a", "b"]
[[takes]]
name = "walk"
[takes.footage]
a = "raw/walk/a.mp4"
b = "raw/walk/b.mp4"
)");
  for (const char* file : {"raw/walk/a.mp4", "raw/walk/b.mp4"}) Put(folder / file, file);
  DatasetBuildOptions options;
  options.take.session = folder.path();
  const auto said = [&] { return MessageOf<UsageError>([&] { RunDatasetBuild(options); }); };
  EXPECT_THAT(said(), HasSubstr("run mvstudio calibrate option 'session' " + folder.path()));
  Put(folder / "calib/calibration.json", "{}");
  EXPECT_THAT(said(), HasSubstr("run mvstudio triangulate option 'session' " + folder.path()));
}

TEST(DatasetBuildStage, TheListHasEveryOption) {
  DatasetBuildOptions options;
  std::vector<std::string> names;
  VisitFields([&](const std::string& name, const auto&, const std::string&) { names.push_back(name); }, options);
  for (const char* name : {"calib", "video", "plate", "session", "pose3d", "skeleton", "out", "masks", "no-masks", "png"})
    EXPECT_THAT(names, Contains(name));
}

}  // namespace
}  // namespace mvstudio::stages
