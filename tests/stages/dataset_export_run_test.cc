#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "stages/dataset_export/describe.h"
#include "stages/dataset_export/run.h"
#include "tests/pack/pack_test_util.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

/// The joints of frames 6 and 7 as a table; the dataset has two cameras and the frames 5 to 8.
DatasetExportOptions StudioToExport(const TempDir& folder) {
  dataset::WriteStudio(folder / "dataset", 2, 4);
  DatasetExportOptions options;
  options.dataset = folder / "dataset", options.to = "csv", options.out = folder / "table";
  options.frames = "6-7";
  return options;
}

TEST(DatasetExportStage, AFolderHoldsTheFramesAskedFor) {
  const TempDir folder;
  const DatasetExportOptions options = StudioToExport(folder);
  const DatasetExportReport report = RunDatasetExport(options);
  EXPECT_FALSE(report.one_file);
  EXPECT_THAT(report.written.frames, ElementsAre(6, 7));
  EXPECT_EQ(report.written.people, 1);
  EXPECT_TRUE(std::filesystem::exists(options.out + "/export.json"));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_EQ(said.folder, options.out);
  EXPECT_EQ(said.metrics["num_frames"], 2);
  ASSERT_EQ(said.outputs.size(), 1 + report.written.files.size());
  for (const auto& output : said.outputs) EXPECT_TRUE(std::filesystem::exists(output.path)) << output.path;
  EXPECT_THAT(said.inputs, ElementsAre(options.dataset));
}

TEST(DatasetExportStage, OneFileIsKeptBesideWhatWasThere) {
  const TempDir folder;
  DatasetExportOptions options = StudioToExport(folder);
  options.out = folder / "joints.csv", options.frames = "all", options.layout.cameras = {"00_00,00_01"};
  const DatasetExportReport report = RunDatasetExport(options);
  EXPECT_TRUE(report.one_file);
  EXPECT_THAT(report.written.frames, ElementsAre(5, 6, 7, 8));
  EXPECT_EQ(report.written.cameras.size(), 2u);
  const std::string table = ReadFile(options.out);
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 1 + 4 * 18) << "all joints but one in each frame";
  const CommandResult said = Describe(report);
  EXPECT_EQ(std::filesystem::path(said.folder), std::filesystem::canonical(folder.path()));
  ASSERT_EQ(said.outputs.size(), 1u);
  EXPECT_EQ(said.outputs[0].path, options.out);
}

TEST(DatasetExportStage, WithoutImagesTheJointsAreEnough) {
  const TempDir folder;
  const DatasetExportOptions options = StudioToExport(folder);
  std::filesystem::remove_all(options.dataset + "/hdImgs");
  EXPECT_EQ(RunDatasetExport(options).written.people, 1);
}

TEST(DatasetExportStage, WhatIsLackingDecidesTheExitCode) {
  DatasetExportReport report;
  report.options.out = "out", report.options.to = "colmap";
  report.written.people = 1, report.written.missing_images = 2;
  EXPECT_EQ(Describe(report).exit, kExitPartial);
  report.written.people = 0;
  const CommandResult nobody = Describe(report);
  EXPECT_EQ(nobody.exit, kExitQualityGate);
  ASSERT_EQ(nobody.errors.size(), 1u);
  EXPECT_EQ(nobody.errors[0].code, "EXP-NOBODY");
  report.written.images = 1;
  EXPECT_THAT(Describe(report).errors, IsEmpty());
}

TEST(DatasetExportStage, AnUnknownFormatIsRefusedBeforeAnythingIsRead) {
  DatasetExportOptions options;
  options.dataset = "nowhere", options.out = "out", options.to = "colmop";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunDatasetExport(options); }), HasSubstr("colmop"));
}

}  // namespace
}  // namespace mvstudio::stages
