#include "stages/dataset/dataset_report.h"

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

TEST(DatasetReport, FindingsBecomeErrorsWarningsMetricsAndText) {
  using Severity = dataset::Finding::Severity;
  const CommandResult result = DescribeDatasetFindings(
      {{Severity::kError, "DAT-CALIB", "c.json", "is broken"}, {Severity::kWarning, "DAT-MASK", "m.png", "is odd"}});
  ASSERT_EQ(result.errors.size(), 1u);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.errors[0].code, "DAT-CALIB");
  EXPECT_EQ(result.errors[0].text, "c.json: is broken");
  EXPECT_EQ(result.warnings[0].text, "m.png: is odd");
  ASSERT_EQ(result.metrics["findings"].size(), 2u);
  EXPECT_EQ(result.metrics["findings"][0]["severity"], "error");
  EXPECT_EQ(result.metrics["findings"][1]["severity"], "warning");
  EXPECT_EQ(result.metrics["findings"][1]["path"], "m.png");
  EXPECT_EQ(result.text, "") << "errors and warnings are printed once, as such";
  const CommandResult none = DescribeDatasetFindings({});
  EXPECT_TRUE(none.metrics["findings"].is_array() && none.metrics["findings"].empty());
}

constexpr char kSession[] = R"(schema = "mvstudio.session/1"
units = "mm"
cameras = ["left"]
[[takes]]
name = "walk"
[takes.footage]
left = "raw/walk/left"
)";

TEST(DatasetReport, ASessionIsDescribedNotVerified) {
  const TempDir folder;
  Put(folder / "mvstudio.toml", kSession);
  for (const char* name : {"0001.png", "0002.png"}) dataset::WriteImage(Image(16, 12, 3), folder / "raw/walk/left/" + name);
  Put(folder / "pose2d/walk/left/0.json", "{}");
  const std::string message = MessageOf<UsageError>([&] { VerifyDatasetOrPack(folder.path(), {}, {}); });
  EXPECT_THAT(message, HasSubstr(folder.path() + " is a session"));
  EXPECT_THAT(message, HasSubstr("mvstudio doctor"));
  const CommandResult result = DescribeDataset(folder.path());
  EXPECT_EQ(result.exit, kExitOk);
  EXPECT_EQ(result.metrics["cameras"], 1);
  EXPECT_EQ(result.metrics["units"], "mm");
  EXPECT_TRUE(result.metrics["calibration"].is_null());
  ASSERT_EQ(result.metrics["takes"].size(), 1u);
  EXPECT_EQ(result.metrics["takes"][0]["name"], "walk");
  EXPECT_EQ(result.metrics["takes"][0]["pose2d"], true);
  EXPECT_EQ(result.metrics["takes"][0]["masks"], false);
  EXPECT_EQ(result.metrics["footage"][0]["frames"], 2);
  EXPECT_EQ(result.metrics["footage"][0]["width"], 16);
  EXPECT_THAT(result.text, HasSubstr("no calibration"));
  EXPECT_THAT(result.text, HasSubstr("take walk (people): 1 cameras, pose2d"));
}

TEST(DatasetReport, WhatIsNotThereIsNamed) {
  const TempDir folder;
  EXPECT_THAT(MessageOf<IoError>([&] { DescribeDataset(folder / "none"); }), HasSubstr(folder / "none"));
  EXPECT_THAT(MessageOf<IoError>([&] { VerifyDatasetOrPack(folder / "none", {}, {}); }), HasSubstr(folder / "none"));
}

}  // namespace
}  // namespace mvstudio::stages
