#include "stages/pipeline/pipeline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "stages/pipeline/record.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::stages {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::TempDir;

constexpr char kHead[] = R"(schema = "mvstudio.session/1"
units = "m"
board = "chessboard:8x6:60mm"
cameras = ["a", "b"]
)";
constexpr char kBoard[] = R"(
[[takes]]
name = "board"
kind = "board"
[takes.footage]
a = "raw/board/a.mp4"
b = "raw/board/b.mp4"
)";
constexpr char kPeople[] = R"(
[[takes]]
name = "walk"
kind = "people"
[takes.footage]
a = "raw/walk/a.mp4"
b = "raw/walk/b.mp4"
)";

void Put(const std::string& path, const std::string& text = "x") {
  std::filesystem::create_directories(std::filesystem::path(path).parent_path());
  std::ofstream(path) << text;
}

std::vector<PipelineStage> Stages(const TempDir& folder, const std::string& toml, PipelineOptions options = {}) {
  for (const char* file : {"raw/board/a.mp4", "raw/board/b.mp4", "raw/walk/a.mp4", "raw/walk/b.mp4"}) Put(folder / file);
  Put(folder / "mvstudio.toml", toml);
  options.session = folder.path();
  return PipelineOf(dataset::ReadSession(folder.path()), options);
}

const PipelineStage& Find(const std::vector<PipelineStage>& stages, StageKind kind) {
  for (const PipelineStage& stage : stages)
    if (stage.kind == kind) return stage;
  throw Error("no such stage");
}

TEST(Pipeline, EachStageComesAfterThoseThatItReads) {
  const TempDir folder;
  const std::vector<PipelineStage> stages = Stages(folder, std::string(kHead) + kBoard + kPeople);
  for (size_t i = 0; i < stages.size(); ++i) {
    for (size_t later = i; later < stages.size(); ++later) {
      for (const std::string& input : stages[i].inputs)
        EXPECT_NE(input.rfind(stages[later].output, 0), 0u)
            << stages[i].name() << " reads what " << stages[later].name() << " writes";
    }
  }
  EXPECT_THAT(Find(stages, StageKind::kTriangulate).line().Words(),
              ElementsAre("triangulate", "--session", folder.path(), "--take", "walk"));
  EXPECT_THAT(Find(stages, StageKind::kTriangulate).inputs, ::testing::Contains(folder / "calib/calibration.json"));
  EXPECT_THAT(Find(stages, StageKind::kCalibrate).inputs, ElementsAre(folder / "raw/board/a.mp4", folder / "raw/board/b.mp4"));
}

TEST(Pipeline, WhatASessionDoesNotNeedIsLeftOutWithAReason) {
  const TempDir folder, own;
  Put(folder / "pose2d/walk/a/000000000000_keypoints.json", "{}");
  const std::vector<PipelineStage> stages = Stages(folder, std::string(kHead) + kBoard + kPeople);
  EXPECT_THAT(Find(stages, StageKind::kCalibrate).left_out, IsEmpty());
  EXPECT_THAT(Find(stages, StageKind::kTimeline).left_out, HasSubstr("no table of time stamps"));
  EXPECT_THAT(Find(stages, StageKind::kPose2d).left_out, HasSubstr("of another program"));
  EXPECT_THAT(Find(stages, StageKind::kPack).left_out, HasSubstr("[run.pack]"));
  EXPECT_THROW(Stages(own, std::string(kHead) + kPeople), UsageError) << "no board, no calibration";
  Put(own / "calibration.json", "{}");
  EXPECT_THAT(Find(Stages(own, std::string(kHead) + kPeople), StageKind::kCalibrate).left_out,
              HasSubstr("no take with a board"));
}

TEST(Pipeline, SettingsOfTheSessionAreFlags) {
  const TempDir folder;
  const std::string settings = "\n[run.avatar]\nsteps = 20\nraw = true\nother = false\nnames = [\"x\", \"y\"]\n[run.pack]\n";
  const std::vector<PipelineStage> stages = Stages(folder, std::string(kHead) + kBoard + kPeople + settings);
  const std::vector<std::string> words = Find(stages, StageKind::kAvatar).line().Words();
  EXPECT_THAT(std::vector<std::string>(words.end() - 7, words.end()),
              ElementsAre("--names", "x", "--names", "y", "--raw", "--steps", "20"));
  EXPECT_THAT(Find(stages, StageKind::kPack).left_out, IsEmpty());
  const dataset::Session session = dataset::ReadSession(folder.path());
  EXPECT_THAT(session.warnings, IsEmpty());
  Put(folder / "mvstudio.toml", dataset::SessionText(session));
  PipelineOptions options;
  options.session = folder.path();
  EXPECT_EQ(Find(PipelineOf(dataset::ReadSession(folder.path()), options), StageKind::kAvatar).line().Words(), words);
  EXPECT_THROW(Stages(folder, std::string(kHead) + kBoard + kPeople + "\n[run.calibrat]\n"), FormatError);
}

TEST(Pipeline, FromToAndOnlyChoose) {
  PipelineStage mask;
  mask.kind = StageKind::kMask;
  PipelineOptions options;
  EXPECT_TRUE(IsAskedFor(mask, options));
  options.to = StageKind::kTriangulate;
  EXPECT_FALSE(IsAskedFor(mask, options));
  options.from = StageKind::kDataset;
  EXPECT_THROW(IsAskedFor(mask, options), UsageError);
  options = {};
  options.only = {"mask", "eval"};
  EXPECT_TRUE(IsAskedFor(mask, options));
  options.only = {"masks"};
  EXPECT_THROW(IsAskedFor(mask, options), UsageError);
}

struct StageOnDisk : ::testing::Test {
  StageOnDisk() {
    Put(folder / "in/a", "one");
    Put(folder / "in/b", "two");
    Put(folder / "out/result", "three");
    stage.command = {"calibrate"};
    stage.options = {{"lens", {"brown4"}}};
    stage.inputs = {folder / "in", folder / "none"};
    stage.output = folder / "out";
    before = RecordOf(stage, "1", nullptr);
  }
  std::string Why() const { return WhyStale(stage, RecordOf(stage, "1", &before), &before); }
  const TempDir folder;
  PipelineStage stage;
  StageRecord before;
};

TEST_F(StageOnDisk, IsUpToDateUntilSomethingCounts) {
  EXPECT_EQ(Why(), "");
  using namespace std::chrono_literals;
  const std::filesystem::path file = folder / "in/b";
  std::filesystem::last_write_time(file, std::filesystem::last_write_time(file) + 1h);
  EXPECT_EQ(Why(), "") << "touched, the same content";
  Put(folder / "in/provenance.jsonl", "a record is no input");
  EXPECT_EQ(Why(), "");
}

TEST_F(StageOnDisk, AReportThatDoesNotTellOfAFailureIsNotUpToDate) {
  StageRecord failed;
  failed.errors = {{"CAL-UNSOLVED", "no camera", "", true}};
  StageRecord now = RecordOf(stage, "1", &before);
  now.told = FailuresIn({{"calibrate", failed}, {"sync", StageRecord()}});
  EXPECT_EQ(now.told, std::vector<std::string>{"calibrate: CAL-UNSOLVED no camera"});
  EXPECT_EQ(WhyStale(stage, now, &before), "it does not tell what failed since");
  before.told = now.told;
  EXPECT_EQ(WhyStale(stage, now, &before), "");
  WriteStageRecords(folder / "run.json", {{"report", now}});
  EXPECT_EQ(ReadStageRecords(folder / "run.json").at("report").told, now.told);
  now.told.clear();
  EXPECT_NE(WhyStale(stage, now, &before), "") << "the failure is mended, and still on the page";
}

TEST_F(StageOnDisk, TellsWhyItHasToBeDone) {
  EXPECT_EQ(WhyStale(stage, before, nullptr), "not done yet");
  EXPECT_EQ(WhyStale(stage, RecordOf(stage, "2", &before), &before), "done by version 1");
  Put(folder / "in/b", "2 more");
  EXPECT_EQ(Why(), folder / "in changed");
  Put(folder / "in/b", "two");
  EXPECT_EQ(Why(), "");
  Put(folder / "none", "now there");
  EXPECT_EQ(Why(), folder / "none is new");
  std::filesystem::remove(folder / "none");
  stage.options.back().values.back() = "brown5";
  EXPECT_EQ(Why(), "other flags: brown4 -> brown5");
  stage.options.back().values.back() = "brown4";
  before.exit = 4;
  EXPECT_EQ(Why(), "ended with exit code 4");
  stage.may_fail = true;
  EXPECT_EQ(Why(), "");
  before.exit = 130;
  EXPECT_EQ(Why(), "ended with exit code 130") << "a signal settles nothing";
  before.exit = kBegun;
  EXPECT_EQ(Why(), "was interrupted");
  stage.may_fail = false, before.exit = 4;
  before.accepted = {"CAL-FOLD"};
  EXPECT_EQ(Why(), "");
  std::filesystem::remove(folder / "out/result");
  EXPECT_EQ(Why(), folder / "out is gone");
}

/// Same size, another content, the time of change put back: no stamp of a file system tells that; a content read anew does.
TEST_F(StageOnDisk, ContentsDecideWhereTheStampDiffers) {
  Put(folder / "in/a", "ONE");
  EXPECT_EQ(Why(), folder / "in changed");
}

TEST_F(StageOnDisk, RecordsAreReadBack) {
  stage.session = folder.path();
  before = RecordOf(stage, "1", nullptr);
  EXPECT_EQ(before.inputs[0].path, "in") << "from the session's folder";
  before.accepted = {"CAL-FOLD"};
  before.seconds = 1.5;
  WriteStageRecords(folder / "run.json", {{"calibrate", before}});
  const StageRecords read = ReadStageRecords(folder / "run.json");
  ASSERT_EQ(read.count("calibrate"), 1u);
  before = read.at("calibrate");
  EXPECT_EQ(before.seconds, 1.5);
  EXPECT_EQ(Why(), "");
  Put(folder / "bad.json", "{\"schema\": 3}");
  EXPECT_THROW(ReadStageRecords(folder / "bad.json"), FormatError);
}

TEST_F(StageOnDisk, AnOutputMadeByOtherMeansHoldsWhileItIsNewer) {
  EXPECT_TRUE(IsNewerThanInputs(stage));
  using namespace std::chrono_literals;
  const std::filesystem::path file = folder / "in/b";
  std::filesystem::last_write_time(file, std::filesystem::last_write_time(file) + 1h);
  EXPECT_FALSE(IsNewerThanInputs(stage));
  stage.output = folder / "nothing";
  EXPECT_FALSE(IsNewerThanInputs(stage));
}

}  // namespace
}  // namespace mvstudio::stages
