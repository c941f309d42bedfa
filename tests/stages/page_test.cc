#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "core/error.h"
#include "stages/report/describe.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

void SaveCalibrate(const std::string& run, double rms_px) {
  const nlohmann::json result = {{"schema", "mvstudio.result/1"},
                                 {"command", "calibrate"},
                                 {"status", "ok"},
                                 {"exit", 0},
                                 {"metrics", {{"holdout_rms_px", rms_px}}}};
  WriteFileAtomic(run + "/calibrate.result.json", result.dump());
}

TEST(PageStage, OneRunHasItsReportAndSeveralTheirComparison) {
  const TempDir folder;
  const std::string before = folder / "before", after = folder / "after";
  SaveCalibrate(before, 0.4), SaveCalibrate(after, 0.3);
  PageOptions options;
  options.runs = {before};
  const CommandResult alone = Describe(RunPage(options));
  EXPECT_EQ(alone.exit, 0);
  EXPECT_TRUE(std::filesystem::exists(before + "/report.json"));
  EXPECT_THAT(alone.text, HasSubstr("Report: "));
  options.runs = {before, after};
  const CommandResult both = Describe(RunPage(options));
  EXPECT_EQ(both.exit, 0);
  EXPECT_EQ(both.outputs[0].path, after + "/comparison.html");
  EXPECT_TRUE(std::filesystem::exists(after + "/comparison.json"));
  EXPECT_THAT(both.inputs, ElementsAre(before, after));
  EXPECT_THAT(both.text, HasSubstr("The calibration of after is better than that of before"));
  EXPECT_EQ(both.metrics["sentence"].get<std::string>() + "\n", both.text.substr(0, both.text.find("Report: ")));
}

TEST(PageStage, AFolderThatIsNotThereIsNotMade) {
  const TempDir folder;
  SaveCalibrate(folder / "run", 0.4);
  PageOptions options;
  for (const auto& runs : {std::vector<std::string>{folder / "gone"}, {folder / "run", folder / "gone"}}) {
    options.runs = runs;
    EXPECT_THROW(RunPage(options), IoError);
    EXPECT_FALSE(std::filesystem::exists(folder / "gone"));
  }
}

TEST(PageStage, TextsCanBeChangedBeforeTheyAreWritten) {
  const TempDir folder;
  SaveCalibrate(folder.path(), 0.4);
  PageOptions options;
  options.runs = {folder.path()}, options.out = folder / "page.html";
  RunPage(options, [](report::Report* page) { page->html = "changed"; });
  EXPECT_EQ(ReadFile(folder / "page.html"), "changed");
}

TEST(PageStage, APageThatSomebodyElseWroteIsKept) {
  const TempDir folder;
  SaveCalibrate(folder / "run", 0.4);
  std::filesystem::create_directories(folder / "mine");
  {
    std::FILE* file = std::fopen((folder / "mine/page.html").c_str(), "w");
    std::fputs("mine", file), std::fclose(file);
  }
  PageOptions options;
  options.runs = {folder / "run"}, options.out = folder / "mine/page.html";
  EXPECT_THROW(RunPage(options), Error);
  EXPECT_EQ(ReadFile(folder / "mine/page.html"), "mine");
}

}  // namespace
}  // namespace mvstudio::stages
