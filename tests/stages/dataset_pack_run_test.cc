#include <filesystem>

#include "core/error.h"
#include "stages/dataset_pack/describe.h"
#include "stages/dataset_pack/run.h"
#include "tests/pack/pack_test_util.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

using ::testing::Contains;

/// Two cameras and four frames, from frame 5.
DatasetPackOptions StudioToPack(const TempDir& folder) {
  dataset::WriteStudio(folder / "dataset", 2, 4);
  DatasetPackOptions options;
  options.dataset = folder / "dataset", options.out = folder / "pack";
  options.pack = dataset::SmallPack();
  return options;
}

TEST(DatasetPackStage, ThePackHoldsEachImageOfThePerson) {
  const TempDir folder;
  DatasetPackOptions options = StudioToPack(folder);
  options.single = folder / "one.h5";
  const DatasetPackReport report = RunDatasetPack(options);
  EXPECT_TRUE(report.built.complete);
  EXPECT_EQ(report.built.samples, 8);
  EXPECT_FALSE(report.lost);
  EXPECT_TRUE(report.wrote_single);
  EXPECT_EQ(dataset::EverythingOf(options.single, {}), dataset::EverythingOf(options.out, {}));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_EQ(said.metrics["samples"], 8);
  EXPECT_EQ(said.metrics["complete"], true);
  EXPECT_FALSE(said.metrics.contains("lost_joints"));
  ASSERT_EQ(said.outputs.size(), 2u);
  EXPECT_EQ(said.outputs[1].path, options.single);
  EXPECT_THAT(said.inputs, Contains(options.dataset));
  EXPECT_THAT(said.errors, IsEmpty());
}

TEST(DatasetPackStage, SharesMergeToTheWholePack) {
  const TempDir folder;
  DatasetPackOptions whole = StudioToPack(folder);
  whole.frames = "5-8";
  DatasetPackOptions share = whole;
  share.out = folder / "shares";
  RunDatasetPack(whole);
  share.shard = "1/2";
  EXPECT_FALSE(RunDatasetPack(share).built.complete);
  share.shard = "0/2";
  RunDatasetPack(share);
  DatasetPackOptions merge;
  merge.merge = true, merge.out = share.out;
  const DatasetPackReport report = RunDatasetPack(merge);
  EXPECT_TRUE(report.built.complete);
  EXPECT_EQ(report.built.samples, 8);
  EXPECT_EQ(dataset::EverythingOf(share.out, {}), dataset::EverythingOf(whole.out, {}));
  EXPECT_THAT(Describe(report).inputs, IsEmpty());
}

TEST(DatasetPackStage, AnImageThatIsNotThereMakesItPartial) {
  const TempDir folder;
  const DatasetPackOptions options = StudioToPack(folder);
  std::filesystem::remove(dataset::OpenPanopticDataset(options.dataset).ImagePath("00_01", 6));
  const DatasetPackReport report = RunDatasetPack(options);
  EXPECT_EQ(report.built.samples, 7);
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitPartial);
  ASSERT_FALSE(said.warnings.empty());
  EXPECT_EQ(said.warnings[0].code, "PCK-SKIPPED");
}

TEST(DatasetPackStage, LostJointsComeBeforeAllElse) {
  DatasetPackReport report;
  report.lost = LostJoints{"d/hdPose3d_stage1_mouse", "mouse", {"tail"}, 20};
  report.built.busy = {3}, report.built.busy_owner = "host:1";
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitTryAgain);
  EXPECT_EQ(said.metrics.begin().key(), "lost_joints");
  ASSERT_EQ(said.warnings.size(), 1u);
  EXPECT_EQ(said.warnings[0].text, "a pack holds Panoptic's 19 joints alone: 1 of the 20 joints of 'mouse' are left out, tail");
  ASSERT_EQ(said.errors.size(), 1u);
  EXPECT_EQ(said.errors[0].text, "shards being made by someone else: 3 (host:1)");
}

TEST(DatasetPackStage, UsesThatExcludeEachOtherAreRefused) {
  const auto refused = [](const DatasetPackOptions& options) {
    return MessageOf<UsageError>([&] { RunDatasetPack(options); });
  };
  DatasetPackOptions options;
  EXPECT_THAT(refused(options), HasSubstr("the dataset folder is missing (only option 'merge' does without)"));
  options.dataset = "d", options.out = "p", options.shard = "2/2";
  EXPECT_THAT(refused(options), HasSubstr("option 'shard' '2/2': use K/N"));
  options.merge = true;
  EXPECT_THAT(refused(options), HasSubstr("option 'merge' and option 'shard' exclude each other"));
  options.merge = false, options.single = "one.h5";
  EXPECT_THAT(refused(options), HasSubstr("option 'single' needs the whole pack"));
  options.shard = "", options.single = "p/INDEX.json";
  EXPECT_THAT(refused(options), HasSubstr("the pack itself has a file of this kind there"));
}

}  // namespace
}  // namespace mvstudio::stages
