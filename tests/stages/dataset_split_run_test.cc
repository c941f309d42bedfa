#include <cmath>

#include "core/error.h"
#include "stages/dataset_split/describe.h"
#include "stages/dataset_split/run.h"
#include "tests/pack/pack_test_util.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

/// Four cameras and the frames 5 to 16, of which the last four and the last camera test.
DatasetSplitOptions StudioToSplit(const TempDir& folder) {
  dataset::WriteStudio(folder / "dataset", 4, 12);
  DatasetSplitOptions options;
  options.dataset = folder / "dataset", options.out = folder / "split.json";
  options.split.test_cameras = {"00_03"};
  options.test_frames = "13-16", options.split.guard_frames = 2;
  return options;
}

TEST(DatasetSplitStage, PartsAreThoseAskedForAndOfTheFile) {
  const TempDir folder;
  const DatasetSplitOptions options = StudioToSplit(folder);
  const DatasetSplitReport report = RunDatasetSplit(options);
  EXPECT_THAT(report.split.train.cameras, ElementsAre("00_00", "00_01", "00_02"));
  EXPECT_THAT(report.split.train.frames, ElementsAre(5, 6, 7, 8, 9, 10));
  EXPECT_THAT(report.split.test.cameras, ElementsAre("00_03"));
  EXPECT_THAT(report.split.test.frames, ElementsAre(13, 14, 15, 16));
  EXPECT_THAT(report.split.unused_frames, ElementsAre(11, 12));
  EXPECT_EQ(dataset::SplitToJsonText(dataset::ReadSplit(options.out)), dataset::SplitToJsonText(report.split));
  ASSERT_EQ(report.distance.test_cameras.size(), 1u);
  EXPECT_EQ(report.distance.test_cameras[0].nearest_train, "00_02");
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.metrics["test"]["frames"], 4);
  EXPECT_EQ(said.metrics["unused_frames"], 2);
  EXPECT_THAT(said.inputs, ElementsAre(options.dataset));
  ASSERT_EQ(said.outputs.size(), 1u);
  EXPECT_EQ(said.outputs[0].path, options.out);
}

TEST(DatasetSplitStage, ASplitThatIsThereIsDescribed) {
  const TempDir folder;
  const DatasetSplitOptions options = StudioToSplit(folder);
  const DatasetSplitReport made = RunDatasetSplit(options);
  DatasetSplitOptions again;
  again.dataset = options.dataset, again.describe = options.out;
  const DatasetSplitReport report = RunDatasetSplit(again);
  EXPECT_EQ(dataset::SplitToJsonText(report.split), dataset::SplitToJsonText(made.split));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.metrics, Describe(made).metrics);
  EXPECT_THAT(said.inputs, ElementsAre(options.dataset, options.out));
  EXPECT_THAT(said.outputs, IsEmpty());
}

TEST(DatasetSplitStage, FramesThatAreNotThereAreNamed) {
  const TempDir folder;
  DatasetSplitOptions options = StudioToSplit(folder);
  options.test_frames = "13-20";
  const DatasetSplitReport report = RunDatasetSplit(options);
  EXPECT_THAT(report.split.test.frames, ElementsAre(13, 14, 15, 16));
  ASSERT_EQ(report.notes.warnings.size(), 1u);
  EXPECT_EQ(report.notes.warnings[0].code, "CLI-FRAMES");
  EXPECT_THAT(report.notes.warnings[0].text, HasSubstr("option 'holdout-frames'"));
  options.out = "";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunDatasetSplit(options); }), HasSubstr("option 'out' is needed"));
}

TEST(DatasetSplitStage, ATestThatSaysLittleIsNamed) {
  DatasetSplitReport report;
  report.distance.median_novelty_m = 0.015, report.distance.usual_step_m = 0.01;
  const CommandResult near = Describe(report);
  EXPECT_EQ(near.exit, kExitOk);
  ASSERT_EQ(near.warnings.size(), 1u);
  EXPECT_EQ(near.warnings[0].code, "SPL-NEAR");
  report.distance.median_novelty_m = std::nan("");
  const CommandResult nobody = Describe(report);
  EXPECT_EQ(nobody.exit, kExitQualityGate);
  EXPECT_THAT(nobody.warnings, IsEmpty());
  ASSERT_EQ(nobody.errors.size(), 1u);
  EXPECT_EQ(nobody.errors[0].code, "SPL-NOBODY");
}

}  // namespace
}  // namespace mvstudio::stages
