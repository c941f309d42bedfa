#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>

#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/error.h"
#include "stages/pipeline/describe.h"
#include "stages/pipeline/run.h"
#include "stages/plan/describe.h"
#include "stages/plan/run.h"
#include "tests/support/temp_dir.h"

/// The walk over a session's stages, with calls that only write what the stage would write.
namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr char kSession[] = R"(schema = "mvstudio.session/1"
units = "m"
board = "chessboard:8x6:60mm"
cameras = ["a"]
[[takes]]
name = "board"
kind = "board"
[takes.footage]
a = "raw/board/a.mp4"
[[takes]]
name = "walk"
kind = "people"
[takes.footage]
a = "raw/walk/a.mp4"
)";

void Write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  WriteFileAtomic(path.string(), text);
}

struct Road : ::testing::Test {
  Road() {
    Write(Path("mvstudio.toml"), kSession);
    for (const char* file : {"raw/board/a.mp4", "raw/walk/a.mp4"}) Write(Path(file), file);
    options.session = Session();
    options.to = StageKind::kTriangulate;
    tools.version = "1";
    tools.call = [this](const CommandLine& line) { return Call(line.command.front()); };
  }
  std::string Session() const { return (fs::path(folder.path()) / name).string(); }
  fs::path Path(const std::string& file) const { return fs::path(Session()) / file; }

  CallOutcome Call(const std::string& command) {
    called.push_back(command);
    const std::map<std::string, std::string> outputs = {{"calibrate", "calib/calibration.json"},
                                                        {"pose2d", "pose2d/walk/a/0.json"},
                                                        {"sync", "sync/walk/sync.json"},
                                                        {"triangulate", "pose3d/walk/points.csv"}};
    CallOutcome outcome;
    outcome.seconds = 2;
    if (command == fails) {
      outcome.result.exit = exit_of_failure;
      outcome.result.errors = {{"CAL-FOLD", "the board bends", "hold it flat", true}};
    }
    SetWriterName(command, "1");  // 2D joints of another writer are left alone
    if (command != fails || exit_of_failure == kExitQualityGate)
      Write(Path(outputs.at(command)), command + (content.empty() ? "" : " " + content));
    return outcome;
  }
  std::map<std::string, std::string> Run() {
    called.clear();
    report = RunPipeline(options, tools);
    std::map<std::string, std::string> states;
    for (const StageRow& row : report.rows) states[row.stage] = ToString(row.state);
    return states;
  }
  std::string ReasonOf(const std::string& stage) const {
    for (const StageRow& row : report.rows)
      if (row.stage == stage) return row.reason;
    return "no such stage";
  }
  std::vector<std::string> TasksOf(const std::string& out) {
    PlanOptions plan;
    plan.pipeline = options, plan.out = folder / out;
    std::vector<std::string> names;
    for (const PlanTask& task : WritePlan(plan, tools).plan.tasks) names.push_back(task.stage.name());
    return names;
  }

  const testing::TempDir folder;
  std::string name = "s", content, fails;
  int exit_of_failure = kExitBadInput;
  PipelineOptions options;
  PipelineTools tools;
  PipelineReport report;
  std::vector<std::string> called;
};

TEST_F(Road, DoesWhatIsNotUpToDateAndNothingElse) {
  Run();
  EXPECT_THAT(called, ElementsAre("calibrate", "pose2d", "sync", "triangulate"));
  Run();
  EXPECT_THAT(called, IsEmpty());
  Write(Path("raw/walk/a.mp4"), "filmed again");
  Run();
  EXPECT_THAT(called, ElementsAre("pose2d")) << "which found the same joints";
  Write(Path("raw/walk/a.mp4"), "and again");
  content = "other joints";
  Run();
  EXPECT_THAT(called, ElementsAre("pose2d", "sync", "triangulate"));
}

TEST_F(Road, ASessionMayBeMovedAndNamedInOtherWays) {
  Run();
  options.session = Session() + "/";
  Run();
  EXPECT_THAT(called, IsEmpty()) << Describe(report).text;
  options.session = fs::relative(Session()).string();
  Run();
  EXPECT_THAT(called, IsEmpty()) << Describe(report).text;
  fs::rename(Session(), folder / "moved");
  name = "moved", options.session = Session();
  Run();
  EXPECT_THAT(called, IsEmpty()) << Describe(report).text;
  EXPECT_THAT(TasksOf("plan"), IsEmpty());
}

TEST_F(Road, ADryRunCallsNothingAndSaysWhatWouldBe) {
  options.dry_run = true;
  EXPECT_EQ(Run()["triangulate walk"], "to do");
  EXPECT_EQ(ReasonOf("triangulate walk"), "after calibrate");
  EXPECT_THAT(called, IsEmpty());
  EXPECT_FALSE(fs::exists(Path("run.json")));
}

TEST_F(Road, APlanHoldsWhatADryRunWouldDo) {
  EXPECT_THAT(TasksOf("first"), ElementsAre("calibrate", "pose2d walk", "sync walk", "triangulate walk"));
  Run();
  EXPECT_THAT(TasksOf("second"), IsEmpty());
  EXPECT_EQ(JobsStatus(folder / "second").rows.size(), 0u);
  EXPECT_EQ(Describe(JobsStatus(folder / "second")).exit, 0);
  EXPECT_THROW(RunTask({folder / "second", 1, false}, tools), UsageError);
  Write(Path("pose2d/walk/a/0.json"), "changed by hand");
  EXPECT_THAT(TasksOf("third"), ElementsAre("sync walk", "triangulate walk"));
  options.only = {"pack"};
  options.to = StageKind::kReport;
  EXPECT_THAT(TasksOf("fourth"), ElementsAre("pack walk")) << "named, therefore needed";
  options.only = {"timeline"};
  EXPECT_THROW(TasksOf("fifth"), UsageError);
}

TEST_F(Road, WhatOthersMadeIsATaskWhichFindsIt) {
  Write(Path("calib/calibration.json"), "by hand");
  EXPECT_THAT(TasksOf("plan"), ElementsAre("calibrate", "pose2d walk", "sync walk", "triangulate walk"));
  const TaskReport task = RunTask({folder / "plan", 1, false}, tools);
  EXPECT_EQ(task.row.state, RowState::kUpToDate);
  EXPECT_THAT(task.row.reason, HasSubstr("found"));
  EXPECT_THAT(called, IsEmpty());
  RunTask({folder / "plan", 1, true}, tools);
  EXPECT_THAT(called, ElementsAre("calibrate"));
}

TEST_F(Road, AFailureStopsItAndIsKept) {
  fails = "calibrate";
  const auto states = Run();
  EXPECT_EQ(states.at("calibrate"), "failed");
  EXPECT_EQ(states.at("triangulate walk"), "not reached");
  EXPECT_EQ(report.exit, kExitBadInput);
  EXPECT_THAT(report.errors.at(0).text, HasSubstr("calibrate: the board bends"));
  ASSERT_EQ(ReadStageRecords(Path("run.json").string()).at("calibrate").errors.size(), 1u);
  Run();
  EXPECT_EQ(ReasonOf("calibrate"), "CAL-FOLD") << "it is tried again";
  fails.clear();
  Run();
  EXPECT_EQ(report.exit, 0);
}

TEST_F(Road, AnErrorThatIsAcceptedStopsNothing) {
  fails = "calibrate", exit_of_failure = kExitQualityGate;
  EXPECT_EQ(Run()["calibrate"], "failed");
  options.accept = {"CAL-FOLD"};
  auto states = Run();
  EXPECT_EQ(states["calibrate"], "accepted");
  EXPECT_EQ(states["triangulate walk"], "done");
  options.accept.clear();
  EXPECT_EQ(Run()["calibrate"], "up to date");
}

TEST_F(Road, WhatOthersMadeAndIsOlderIsNotReplaced) {
  Write(Path("calib/calibration.json"), "by hand");
  fs::last_write_time(Path("calib/calibration.json"), fs::last_write_time(Path("raw/board/a.mp4")) - std::chrono::hours(1));
  EXPECT_EQ(Run()["calibrate"], "failed");
  EXPECT_EQ(report.errors.at(0).code, "RUN-EXISTS");
  EXPECT_THAT(called, IsEmpty());
  EXPECT_EQ(ReadFile(Path("calib/calibration.json").string()), "by hand");
}

}  // namespace
}  // namespace mvstudio::stages
