#include "core/error.h"
#include "stages/avatar_compare/describe.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

TEST(AvatarCompareStage, WhatSaysLittleIsWarnedOfInItsOrder) {
  AvatarCompareReport report;
  report.options.out = "table.md", report.protocol_sha256 = "abc";
  ComparisonRow& row = report.comparison.rows.emplace_back();
  row.name = "tna", row.folders = {"a", "b"}, row.seeds = {"7", "7"};
  row.splits["cameras"].values["ssim"] = SpreadOf({0.9, 0.8});
  report.comparison.mixed_splits = {"cameras"};
  report.comparison.differences = {{"direct", "tna", -0.05, false, false}};
  report.not_judged = {"other"};
  const CommandResult said = Describe(report);
  ASSERT_EQ(said.warnings.size(), 3u);
  EXPECT_EQ(said.warnings[0].code, "CMP-SEED");
  EXPECT_EQ(said.warnings[1].code, "CMP-STUDY");
  EXPECT_EQ(said.warnings[2].code, "CMP-SPLIT");
  EXPECT_THAT(said.warnings[0].text, HasSubstr("several runs of seed 7"));
  EXPECT_EQ(said.metrics["protocol_sha256"], "abc");
  EXPECT_NEAR(said.metrics["rows"][0]["splits"]["cameras"]["ssim"]["mean"].get<double>(), 0.85, 1e-12);
  EXPECT_EQ(said.metrics["rows"][0]["num_runs"], 2);
  EXPECT_TRUE(said.metrics["differences"][0]["outside_spread"].is_null()) << "one run has no spread";
  EXPECT_EQ(said.outputs.at(0).path, "table.md");
}

TEST(AvatarCompareStage, AFolderWithoutScoresIsRefused) {
  const mvstudio::testing::TempDir folder;
  AvatarCompareOptions options;
  options.runs = {folder.path()};
  EXPECT_THROW(RunAvatarCompare(options), Error);
}

}  // namespace
}  // namespace mvstudio::stages
