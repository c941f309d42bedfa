#include "stages/plan/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/part.h"
#include "stages/plan/cut.h"
#include "stages/plan/engines.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr char kTwoTakes[] = R"(schema = "mvstudio.session/1"
units = "m"
board = "chessboard:8x6:60mm"
cameras = ["a"]
[[takes]]
name = "board"
kind = "board"
[takes.footage]
a = "raw/board/a.mp4"
[[takes]]
name = "run"
kind = "people"
[takes.footage]
a = "raw/run/a.mp4"
[[takes]]
name = "walk"
kind = "people"
[takes.footage]
a = "raw/walk/a.mp4"
)";

struct PlanFolder : ::testing::Test {
  PlanFolder() {
    Put("mvstudio.toml", kTwoTakes);
    for (const char* file : {"raw/board/a.mp4", "raw/run/a.mp4", "raw/walk/a.mp4"}) Put(file, file);
    options.session = folder.path();
    options.to = StageKind::kTriangulate;
    plan = MakePlan();
    plan.folder = folder.path();
  }
  Plan MakePlan() const {
    const std::vector<PipelineStage> stages = PipelineOf(dataset::ReadSession(folder.path()), options);
    std::vector<const PipelineStage*> chosen;
    for (const PipelineStage& stage : stages)
      if (IsAskedFor(stage, options) && stage.left_out.empty()) chosen.push_back(&stage);
    return PlanOf(options, chosen, {});
  }
  void Put(const std::string& name, const std::string& text) const {
    const std::string path = folder / name;
    fs::create_directories(fs::path(path).parent_path());
    std::ofstream(path) << text;
  }
  std::string Text(Engine engine, std::vector<int> ids = {1, 2, 3, 4, 5, 6, 7}, EngineOptions limits = {}) const {
    limits.program = "/usr/bin/mvstudio";
    return EngineText(engine, plan, ids, limits);
  }
  /// As `mvstudio task` leaves it.
  void Mark(const PlanTask& task, int exit) const {
    StageRecord record = RecordOf(task.stage, "1", nullptr);
    record.exit = exit;
    const StageRecords records = {{task.stage.name(), record}};
    WriteStageRecords(TriedPath(plan, task), records);
    if (IsSettled(task.stage, record)) WriteStageRecords(MarkerPath(plan, task), records);
  }
  const testing::TempDir folder;
  PipelineOptions options;
  Plan plan;
};

TEST_F(PlanFolder, TasksOfAStageStandInARowAndAfterWhatTheyRead) {
  std::vector<std::string> names;
  for (const PlanTask& task : plan.tasks) names.push_back(task.stage.name());
  EXPECT_THAT(names, ElementsAre("calibrate", "pose2d run", "pose2d walk", "sync run", "sync walk", "triangulate run",
                                 "triangulate walk"));
  EXPECT_THAT(plan.tasks[0].after, IsEmpty());
  EXPECT_THAT(plan.tasks[1].after, ElementsAre(1)) << "by the calibration a net is chosen";
  EXPECT_THAT(plan.tasks[4].after, ElementsAre(1, 3)) << "of its own take alone";
  EXPECT_THAT(plan.tasks[6].after, ElementsAre(1, 3, 5));
  ASSERT_EQ(plan.tasks[0].inputs.size(), 1u);
  EXPECT_EQ(plan.tasks[0].inputs[0].path, folder / "raw/board/a.mp4");
  EXPECT_EQ(plan.tasks[0].inputs[0].sha256.size(), 64u);
}

TEST_F(PlanFolder, IsReadBackAndRefusedWhereItIsCutOff) {
  const std::string text = PlanText(plan);
  Put("plan.jsonl", text);
  const Plan read = ReadPlan(folder.path());
  EXPECT_EQ(PlanText(read), text);
  EXPECT_EQ(TaskOf(read, 7).stage.name(), "triangulate walk");
  EXPECT_THROW(TaskOf(read, 8), UsageError);
  EXPECT_THROW(TaskOf(read, 0), UsageError);
  Put("plan.jsonl", text.substr(0, text.rfind("{\"id\"")));
  EXPECT_THROW(ReadPlan(folder.path()), FormatError);
  Put("plan.jsonl", text.substr(0, text.size() - 20));
  EXPECT_THROW(ReadPlan(folder.path()), FormatError);
  Put("plan.jsonl", "");
  EXPECT_THROW(ReadPlan(folder.path()), FormatError);
  fs::remove(folder / "plan.jsonl");
  EXPECT_THROW(ReadPlan(folder.path()), UsageError);
}

TEST_F(PlanFolder, MarkersSayWhatIsDone) {
  EXPECT_EQ(StatesOf(plan)[0], TaskState::kReady);
  EXPECT_EQ(StatesOf(plan)[3], TaskState::kWaiting);
  Put("calib/calibration.json", "rig");
  Mark(plan.tasks[0], 0);
  EXPECT_EQ(StatesOf(plan)[0], TaskState::kDone);
  Put("calib/calibration.json", "another rig");
  EXPECT_EQ(StatesOf(plan)[0], TaskState::kNotValid);
  Put("pose2d/run/a/0.json", "joints");
  Mark(plan.tasks[1], 6);
  EXPECT_EQ(StatesOf(plan)[1], TaskState::kDone) << "frames are left out";
  Mark(plan.tasks[2], 3);
  EXPECT_EQ(StatesOf(plan)[2], TaskState::kFailed);
  Mark(plan.tasks[3], kBegun);
  EXPECT_EQ(StatesOf(plan)[3], TaskState::kBegun);
  Mark(plan.tasks[4], 4);
  EXPECT_EQ(StatesOf(plan)[4], TaskState::kDone) << "a sync may fail";
}

TEST_F(PlanFolder, WhatWaitsForATaskIsSubmittedWithIt) {
  std::vector<TaskState> states(7, TaskState::kDone);
  EXPECT_THAT(RemainingTasks(plan, states), IsEmpty());
  states[2] = TaskState::kNotValid;
  EXPECT_THAT(RemainingTasks(plan, states), ElementsAre(3, 5, 7));
  Put("pose2d/run/a/0.json", "joints");
  Mark(plan.tasks[1], 0);
  EXPECT_EQ(StatesOf(plan)[1], TaskState::kDone);
  Put("raw/run/a.mp4", "filmed again");
  EXPECT_EQ(StatesOf(plan)[1], TaskState::kNotValid);
}

TEST_F(PlanFolder, AMarkerThatIsNoneCountsAsNone) {
  Put("done/1.json", "");
  EXPECT_EQ(StatesOf(plan)[0], TaskState::kReady);
  Put("calib/calibration.json", "rig");
  StageRecord record = RecordOf(plan.tasks[0].stage, "1", nullptr);
  WriteStageRecords(folder / "done/2.json", {{"calibrate", record}});
  EXPECT_EQ(StatesOf(plan)[1], TaskState::kWaiting) << "of another task; calibrate is not done";
}

TEST_F(PlanFolder, NinjaHasMarkersAsOutputs) {
  const std::string text = Text(Engine::kNinja);
  EXPECT_THAT(text, HasSubstr("restat = 1"));
  EXPECT_THAT(text, HasSubstr("build " + folder / "done/5.json: task " + folder / "done/1.json " + folder / "done/3.json"));
  EXPECT_THAT(text, HasSubstr("build " + folder / "done/1.json: task | " + folder / "raw/board/a.mp4"));
  EXPECT_THAT(Text(Engine::kNinja, {5}), Not(HasSubstr("done/1.json"))) << "what is done is not in it";
}

TEST_F(PlanFolder, PathsAreQuoted) {
  plan.folder = "/my $plan: {it's}";
  EXPECT_THAT(Text(Engine::kNinja), HasSubstr("build /my$ $$plan$:$ {it's}/done/1.json: task"));
  EXPECT_THAT(Text(Engine::kNinja), HasSubstr("task '/my $$plan: {it'\\''s}' $id"));
  EXPECT_THAT(Text(Engine::kSnakemake), HasSubstr("task '/my $plan: {{it'\\\\''s}}' 1"));
  plan.folder = "/two\nlines";
  for (const Engine engine : {Engine::kNinja, Engine::kSlurm, Engine::kSnakemake}) EXPECT_THROW(Text(engine), UsageError);
}

TEST_F(PlanFolder, SlurmGetsAnArrayForEachStage) {
  EngineOptions limits;
  limits.max_running = 5, limits.sbatch = "--partition=main";
  const std::string text = Text(Engine::kSlurm, {1, 2, 3, 4, 5, 6, 7}, limits);
  EXPECT_THAT(text, HasSubstr("--job-name=pose2d --array=0-1%5"));
  EXPECT_THAT(text, HasSubstr("--dependency=afterok:$job1:$job2:$job3 --partition=main"));
  EXPECT_THAT(text, HasSubstr("$((6 + SLURM_ARRAY_TASK_ID))"));
  limits = {};
  limits.max_array = 1;
  const std::string cut = Text(Engine::kSlurm, {1, 2, 3, 4, 5, 6, 7}, limits);
  EXPECT_THAT(cut, HasSubstr("job7=$(sbatch")) << "an array for each task";
  EXPECT_THAT(cut, Not(HasSubstr("--array=0-")));
  EXPECT_THAT(Text(Engine::kSlurm, {3, 7}), HasSubstr("job2=$(sbatch"));
  EXPECT_THAT(Text(Engine::kSlurm, {3, 7}), HasSubstr("--dependency=afterok:$job1 "));
  limits.max_array = 0;
  EXPECT_THROW(Text(Engine::kSlurm, {1}, limits), UsageError);
}

TEST_F(PlanFolder, SlurmIsAskedForTwiceTheMemory) {
  plan.tasks[1].stage.need.memory_mb = 130, plan.tasks[2].stage.need.memory_mb = 260;
  plan.tasks[0].stage.need = {99.5, 0.25};
  EngineOptions limits;
  limits.sbatch = "--mem=1G";
  const std::string text = Text(Engine::kSlurm, {1, 2, 3, 4, 5, 6, 7}, limits);
  EXPECT_THAT(text.substr(0, text.find("job2=")), HasSubstr(" --mem=200M --mem=1G --wrap"));
  EXPECT_THAT(text, HasSubstr(" --mem=600M --mem=1G --wrap")) << "the neediest of two, and the caller has the last word";
  size_t asked = 0;
  for (size_t at = text.find("--mem="); at != std::string::npos; at = text.find("--mem=", at + 1)) ++asked;
  EXPECT_EQ(asked, 2u + 4u) << "two arrays are known, four have the caller's alone";
  Put("plan.jsonl", PlanText(plan));
  const Plan read = ReadPlan(folder.path());
  EXPECT_EQ(read.tasks[0].stage.need.memory_mb, 99.5);
  EXPECT_EQ(read.tasks[0].stage.need.disk_mb, 0.25);
  EXPECT_TRUE(std::isnan(read.tasks[3].stage.need.memory_mb));
}

TEST_F(PlanFolder, TheReportIsMadeAfterFailures) {
  options.to = StageKind::kReport;
  plan = MakePlan();
  std::vector<int> ids;
  for (const PlanTask& task : plan.tasks) ids.push_back(task.id);
  EXPECT_EQ(plan.tasks.back().after.size(), plan.tasks.size() - 1);
  EXPECT_THAT(Text(Engine::kSlurm, ids), HasSubstr("--job-name=report --array=0"));
  EXPECT_THAT(Text(Engine::kSlurm, ids), HasSubstr("--dependency=afterany:$job1:"));
}

/// A take of 700 images of one camera and 10 of another.
TEST(PlanCut, LongStagesAreCutByCamerasAndTime) {
  const testing::TempDir folder;
  const std::string image = dataset::EncodeImage(Image(8, 6, 3), "a.png");
  for (const auto& [camera, frames] : {std::pair("a", 700), std::pair("b", 10)}) {
    fs::create_directories(folder / ("raw/" + std::string(camera)));
    for (int i = 0; i < frames; ++i)
      std::ofstream(folder / ("raw/" + std::string(camera) + "/" + std::to_string(1000 + i) + ".png")) << image;
  }
  std::ofstream(folder / "calibration.json") << "rig";
  std::ofstream(folder / "mvstudio.toml") << R"(schema = "mvstudio.session/1"
units = "m"
calibration = "calibration.json"
cameras = ["a", "b"]
[[takes]]
name = "walk"
kind = "people"
[takes.footage]
a = "raw/a"
b = "raw/b"
)";
  PlanOptions options;
  options.pipeline.session = folder.path(), options.pipeline.to = StageKind::kMask, options.task_seconds = 100;
  const std::vector<PipelineStage> stages = PipelineOf(dataset::ReadSession(folder.path()), options.pipeline);
  std::vector<const PipelineStage*> chosen;
  for (const PipelineStage& stage : stages)
    if (IsAskedFor(stage, options.pipeline) && stage.left_out.empty()) chosen.push_back(&stage);
  const auto chosen_until_verify = [&] {
    std::vector<const PipelineStage*> all;
    for (const PipelineStage& stage : stages)
      if (stage.kind <= StageKind::kVerify && stage.left_out.empty()) all.push_back(&stage);
    return all;
  };
  const auto names = [&](const StageRecords& earlier) {
    const Plan plan = PlanOf(options.pipeline, chosen, earlier, CutStages(options, chosen, earlier, "/plan"));
    std::vector<std::string> all;
    for (const PlanTask& task : plan.tasks) all.push_back(task.stage.name());
    return all;
  };
  EXPECT_THAT(names({}), ElementsAre("pose2d walk choice", "pose2d walk frames=a:0-0", "pose2d walk frames=a:1-1",
                                     "pose2d walk frames=a:2-2", "pose2d walk frames=b", "pose2d walk", "sync walk",
                                     "triangulate walk", "mask walk"))
      << "masks of 710 images take 18 s";
  const Plan plan = PlanOf(options.pipeline, chosen, {}, CutStages(options, chosen, {}, "/plan"));
  EXPECT_THAT(plan.tasks[0].after, IsEmpty());
  EXPECT_THAT(plan.tasks[2].after, ElementsAre(1));
  EXPECT_THAT(plan.tasks[5].after, ElementsAre(2, 3, 4, 5));
  EXPECT_THAT(plan.tasks[6].after, ElementsAre(6)) << "parts are nobody's input";
  EXPECT_NEAR(plan.tasks[2].seconds, 0.41 * 300, 1e-9);
  EXPECT_NEAR(plan.tasks[3].seconds, 0.41 * 100, 1e-9) << "its block is not full";
  EXPECT_TRUE(std::isnan(plan.tasks[5].seconds));
  EXPECT_TRUE(HasParts(plan, plan.tasks[5]));
  EXPECT_FALSE(HasParts(plan, plan.tasks[6]));
  EXPECT_FALSE(HasParts(plan, plan.tasks[1]));
  EXPECT_THAT(plan.tasks[4].stage.inputs, ElementsAre(folder / "raw/b")) << "not what other cameras filmed";
  EXPECT_THAT(plan.tasks[0].stage.inputs, ElementsAre(folder / "raw/a", folder / "raw/b"));
  EXPECT_THAT(plan.tasks[4].stage.line().Text(), HasSubstr("--part frames=b --out /plan/parts/pose2d-walk/1-"));
  EXPECT_THAT(plan.tasks[4].stage.line().Text(), HasSubstr("--cache /plan/kept"));
  const std::string text = PlanText(plan);
  std::ofstream(folder / "plan.jsonl") << text;
  EXPECT_EQ(PlanText(ReadPlan(folder.path())), text);
  EngineOptions limits;
  limits.program = "/usr/bin/mvstudio";
  const std::string slurm = EngineText(Engine::kSlurm, plan, {1, 2, 3, 4, 5, 6}, limits);
  EXPECT_THAT(slurm, HasSubstr("--job-name=pose2d-choice --array=0 "));
  EXPECT_THAT(slurm, HasSubstr("--job-name=pose2d-frames --array=0-3 "));
  EXPECT_THAT(slurm, HasSubstr("--job-name=pose2d --array=0 "));

  options.task_seconds = 200;
  EXPECT_EQ(names({}).size(), 4u) << "291 s are not more than twice 200";
  StageRecord record;
  record.seconds = 5000;  // with two cameras, on two threads at least where the machine has them
  EXPECT_GT(names({{"pose2d walk", record}}).size(), 5u) << "what was measured counts";
  options.task_seconds = 5;
  options.pipeline.to = StageKind::kPose2d;
  const PartsByStage parts = CutStages(options, chosen, {}, "/plan");
  ASSERT_EQ(parts.at("mask walk").size(), 3u) << "samples, choice, frames";
  EXPECT_EQ(parts.at("mask walk")[0].size(), 2u);
  EXPECT_EQ(parts.count("dataset walk"), 0u) << "its images are small";
  options.task_seconds = 0.05;
  const auto shares = CutStages(options, chosen_until_verify(), {}, "/plan").at("verify walk");
  ASSERT_EQ(shares.size(), 1u);
  ASSERT_EQ(shares[0].size(), 2u) << "as many as cameras at most";
  EXPECT_THAT(shares[0][1].stage.line().Text(), HasSubstr("--keep /plan/parts/verify-walk/"));
  EXPECT_THAT(shares[0][1].stage.line().Text(), HasSubstr("--part share=1/2 "));
  options.task_seconds = 1e-3;
  const auto built = CutStages(options, chosen_until_verify(), {}, "/plan").at("dataset walk");
  ASSERT_EQ(built.size(), 2u) << "samples, frames";
  EXPECT_EQ(built[0].size(), 2u);
  options.task_seconds = 10;
  std::ofstream(folder / "mvstudio.toml", std::ios::app)
      << "[run.pose2d]\nbackend = \"movenet\"\n[run.mask]\ncache = \"off\"\n";
  const std::vector<PipelineStage> given = PipelineOf(dataset::ReadSession(folder.path()), options.pipeline);
  chosen.clear();
  for (const PipelineStage& stage : given) chosen.push_back(&stage);
  const PartsByStage others = CutStages(options, chosen, {}, "/plan");
  EXPECT_EQ(others.at("pose2d walk").size(), 1u) << "the net is no question";
  EXPECT_EQ(others.count("mask walk"), 0u) << "its cache was chosen";
  options.task_seconds = 0;
  EXPECT_TRUE(CutStages(options, chosen, {}, "/plan").empty());
  options.task_seconds = -1;
  EXPECT_THROW(CutStages(options, chosen, {}, "/plan"), UsageError);
}

TEST(PlanCut, PartsAreReadAsTheyAreWritten) {
  for (const char* text : {"choice", "samples=cam 1", "frames=a", "frames=a:0-0", "frames=a:b:3-17", "frames=a:b", "share=1/4"})
    EXPECT_EQ(ToString(ParsePart(text)), text);
  EXPECT_EQ(ParsePart("frames=a:b:3-17").camera, "a:b");
  EXPECT_EQ(ParsePart("frames=a:b:3-17").end_block, 18);
  for (const char* text : {"", "frames=", "samples=", "frame=a", "frames=a:5-3", "frames=a:0-99999999999", "share=4/4",
                           "share=1", "share=-1/2", "share=1/2x"})
    EXPECT_THROW(ParsePart(text), UsageError) << text;
}

}  // namespace
}  // namespace mvstudio::stages
