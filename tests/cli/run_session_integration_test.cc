#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "tests/support/run_cli.h"

/// `mvstudio run` on a small studio with truth, as a user runs it.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;

using States = std::map<std::string, std::string>;

States StatesOf(const CliRun& run) {
  States states;
  const nlohmann::json json = run.Json();
  if (!json.is_object()) return states;
  for (const nlohmann::json& row : json["metrics"]["stages"]) states[row["stage"]] = row["state"];
  return states;
}

std::string ReasonOf(const CliRun& run, const std::string& stage) {
  const nlohmann::json json = run.Json();
  for (const nlohmann::json& row : json["metrics"]["stages"]) {
    if (row["stage"] == stage) return row["reason"];
  }
  return "";
}

std::vector<std::string> StagesThatAre(const std::string& state, const CliRun& run) {
  std::vector<std::string> names;
  for (const auto& [name, its] : StatesOf(run))
    if (its == state) names.push_back(name);
  return names;
}

class RunCommand : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempDir;
    const CliRun made = RunCli({"synth", "--out", *folder_ / "s", "--cameras", "3", "--size", "320x240", "--board",
                                "charuco:5x4:240mm:180mm", "--board-frames", "40", "--take-frames", "12"});
    ASSERT_EQ(made.exit, 0) << made.err;
    std::ofstream(*folder_ / "s/mvstudio.toml", std::ios::app) << "\n[run.avatar]\nsteps = 10\nsize = 64\n";
  }
  static void TearDownTestSuite() { delete folder_; }
  static std::string Path(const std::string& name) { return *folder_ / ("s/" + name); }
  static CliRun Run(std::vector<std::string> words) {
    words.insert(words.begin(), {"run", *folder_ / "s", "--json"});
    return RunCli(words);
  }
  static inline TempDir* folder_ = nullptr;
};

/// One test, because each step stands on the last.
TEST_F(RunCommand, DoesWhatIsNotUpToDate) {
  const CliRun plan = Run({"--dry-run"});
  ASSERT_EQ(plan.exit, 0) << plan.err << plan.out;
  EXPECT_EQ(StatesOf(plan)["calibrate"], "to do");
  EXPECT_EQ(StatesOf(plan)["pose2d take1"], "not needed");
  EXPECT_EQ(StatesOf(plan)["report"], "to do");
  EXPECT_FALSE(fs::exists(Path("calib"))) << "a dry run does nothing";
  EXPECT_FALSE(fs::exists(Path("run.json")));
  const CliRun parts = Run({"--dry-run", "--to", "triangulate", "--budget", "605s"});
  ASSERT_EQ(parts.exit, 0) << parts.err << parts.out;
  EXPECT_THAT(ReasonOf(parts, "calibrate"), HasSubstr("its part of the budget: 5min 0s")) << "half of it, but 5 s for sync";
  const CliRun unknown = Run({"--budget", "1h"});
  EXPECT_EQ(unknown.exit, 2) << unknown.out;
  EXPECT_THAT(unknown.out, HasSubstr("how long mask take1 takes"));
  EXPECT_FALSE(fs::exists(Path("calib"))) << "refused before anything is done";

  const CliRun first = Run({});
  ASSERT_THAT(first.exit, ::testing::AnyOf(0, 6)) << first.err << first.out;
  EXPECT_THAT(StagesThatAre("failed", first), ::testing::IsEmpty()) << first.out;
  for (const char* file : {"calib/calibration.json", "pose3d/take1/points.csv", "dataset/take1/dataset.json",
                           "avatar/take1/config.json", "avatar/take1/eval", "report.html", "run.json"})
    EXPECT_TRUE(fs::exists(Path(file))) << file;

  const auto written = fs::last_write_time(Path("avatar/take1/config.json"));
  const CliRun again = Run({});
  EXPECT_THAT(StagesThatAre("done", again), ::testing::ElementsAre()) << again.out;
  EXPECT_EQ(StatesOf(again)["eval take1"], "up to date") << again.out;
  EXPECT_EQ(fs::last_write_time(Path("avatar/take1/config.json")), written);

  // A stage's own result is gone: it is made again, and, as it comes out with the same bytes, nothing after it.
  const std::string points = Slurp(Path("pose3d/take1/points.csv"));
  fs::remove_all(Path("pose3d/take1"));
  const CliRun mended = Run({"--to", "eval"});
  EXPECT_EQ(Slurp(Path("pose3d/take1/points.csv")), points);
  EXPECT_EQ(StatesOf(mended)["calibrate"], "up to date") << mended.out;
  EXPECT_EQ(StatesOf(mended)["triangulate take1"], "done") << mended.out;
  EXPECT_EQ(StatesOf(mended)["avatar take1"], "up to date") << mended.out;

  // With a budget the stage chooses its settings, and what it made is up to date without one.
  fs::remove_all(Path("pose3d/take1"));
  const CliRun budget = Run({"--to", "triangulate", "--budget", "10min"});
  EXPECT_EQ(StatesOf(budget)["triangulate take1"], "done") << budget.out;
  EXPECT_TRUE(fs::exists(Path("pose3d/take1/predictions.jsonl")));
  EXPECT_EQ(StatesOf(Run({"--to", "triangulate"}))["triangulate take1"], "up to date");
}

TEST_F(RunCommand, AFailureStopsItAndTheReportShowsIt) {
  std::ofstream(Path("mvstudio.toml"), std::ios::app) << "\n[run.calibrate]\nlens = \"brown99\"\n";
  const CliRun failed = Run({});
  EXPECT_EQ(failed.exit, 2) << failed.out;
  EXPECT_EQ(StatesOf(failed)["calibrate"], "failed");
  EXPECT_EQ(StatesOf(failed)["dataset take1"], "not reached");
  EXPECT_THAT(failed.Json()["errors"][0]["text"].get<std::string>(), HasSubstr("calibrate: "));
  EXPECT_TRUE(fs::exists(Path("report.html")));
  auto records = nlohmann::ordered_json::parse(Slurp(Path("run.json")));
  auto& known = records["stages"];
  known.erase(std::remove_if(known.begin(), known.end(), [](const auto& stage) { return stage["stage"] == "report"; }),
              known.end());
  std::ofstream(Path("run.json")) << records.dump();
  ASSERT_EQ(RunCli({"report", Path("")}).exit, 0);
  EXPECT_EQ(StatesOf(Run({"--only", "report"}))["report"], "done")
      << "made by hand: whether it tells of the failure is not known";
  EXPECT_EQ(StatesOf(Run({"--only", "report"}))["report"], "up to date");
  const CliRun older = Run({"--only", "triangulate", "--dry-run"});
  ASSERT_FALSE(older.Json()["warnings"].empty()) << older.out;
  EXPECT_EQ(older.Json()["warnings"][0]["code"], "RUN-OLDER");
  EXPECT_THAT(older.Json()["warnings"][0]["text"].get<std::string>(),
              HasSubstr("triangulate take1 reads what calibrate writes"));
}

TEST_F(RunCommand, BadArgumentsEndWithTheirExitCodes) {
  const TempDir empty;
  EXPECT_EQ(RunCli({"run", empty.path()}).exit, 3);
  EXPECT_EQ(Run({"--from", "eval", "--to", "mask"}).exit, 2);
  EXPECT_EQ(Run({"--only", "masks"}).exit, 2);
  EXPECT_EQ(Run({"--take", "none"}).exit, 2);
}

}  // namespace
}  // namespace mvstudio::testing
