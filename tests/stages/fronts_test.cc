#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "stages/fronts/run.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

/// What stages cost and how far off they are, on commands that are only pretended.
namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;
using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

FrontWay WayOf(const std::string& name, double cpu_s, double rss_mb, double error) {
  FrontWay way;
  way.name = name, way.command = "mvstudio " + name;
  way.seconds = 2 * cpu_s, way.cpu_s = cpu_s, way.peak_rss_mb = rss_mb, way.error = error;
  return way;
}

StageFront SmallFront() {
  StageFront front{"mask", "the command", "error (px)", "peak memory (MiB)", "", {}};
  front.ways = {WayOf("quick", 1, 300, 5), WayOf("usual", 2, 100, 4), WayOf("slow", 3, 200, 4.5),
                WayOf("failed", NAN, NAN, NAN)};
  front.ways[1].mark = WayMark::kDefault, front.ways[2].mark = WayMark::kPeer;
  front.ways[3].why_not = "it <broke>";
  MarkFronts(&front);
  return front;
}

Fronts SmallFronts() {
  Fronts fronts;
  fronts.footage = "Session day1", fronts.processor = "Some processor", fronts.cores = 4, fronts.threads = 2, fronts.load = 1.5;
  fronts.seed = 7;
  fronts.stages = {SmallFront(), {"pack", "reading", "error", "space", "no dataset is there", {}}};
  return fronts;
}

std::vector<bool> InTime(const StageFront& front) {
  std::vector<bool> on;
  for (const FrontWay& way : front.ways) on.push_back(way.time_front);
  return on;
}

TEST(Fronts, OnTheFrontIsWhatNoOtherBeats) {
  const StageFront front = SmallFront();
  EXPECT_THAT(InTime(front), ElementsAre(true, true, false, false));
  EXPECT_FALSE(front.ways[0].space_front) << "the usual way takes less memory and is better";
  EXPECT_TRUE(front.ways[1].space_front);
  EXPECT_THAT(front.why_not, IsEmpty());
  StageFront stored = front;
  stored.ways[0].stored_kib = 1, stored.ways[1].stored_kib = 2;
  MarkFronts(&stored);
  EXPECT_TRUE(stored.ways[0].space_front) << "what is stored counts, where it is known";
}

TEST(Fronts, AStageWhoseWaysAllFailSaysWhy) {
  StageFront front = SmallFront();
  for (FrontWay& way : front.ways) way = front.ways[3];
  MarkFronts(&front);
  EXPECT_EQ(front.why_not, "it <broke>");
}

TEST(Fronts, ResultsReadBackGiveTheSamePage) {
  const TempDir folder;
  const Fronts fronts = SmallFronts();
  WriteFileAtomic(folder / "fronts.json", FrontsJson(fronts));
  const Fronts read = ReadFronts(folder / "fronts.json");
  EXPECT_EQ(FrontsJson(read), FrontsJson(fronts));
  const std::string page = FrontsPage(fronts);
  EXPECT_EQ(FrontsPage(read), page);
  EXPECT_THAT(page, HasSubstr("Not measured: no dataset is there"));
  EXPECT_THAT(page, HasSubstr("failed was not measured: it &lt;broke&gt;"));
  EXPECT_THAT(page, HasSubstr("slow (peer)"));
  EXPECT_THAT(page, HasSubstr("<h1>mvstudio tradeoff all</h1>"));
  EXPECT_THAT(page, HasSubstr("seed 7"));
  EXPECT_THAT(page, Not(HasSubstr("nan")));
  WriteFileAtomic(folder / "other.json", R"({"schema": "mvstudio.report/1"})");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadFronts(folder / "other.json"); }), HasSubstr("tradeoff all"));
}

/// A session with all that the stages need, and one take.
void PutSession(const TempDir& folder) {
  std::ofstream(folder / "mvstudio.toml") << R"(schema = "mvstudio.session/1"
units = "m"
board = "chessboard:9x6:25mm"
fps_hz = 25
cameras = ["a", "b"]
[[takes]]
name = "walk"
[takes.footage]
a = "raw/a"
b = "raw/b"
)";
  for (const char* path : {"calib/calibration.json", "pose3d/walk/points.csv", "dataset/walk/dataset.json"}) {
    fs::create_directories(fs::path(folder / path).parent_path());
    std::ofstream(folder / path) << "{}";
  }
}

/// Answers as the commands do; nets are not installed.
struct Pretended {
  std::vector<std::string> lines;

  CallOutcome operator()(const CommandLine& line) {
    lines.push_back(line.Text());
    CallOutcome outcome;
    outcome.seconds = 3, outcome.cpu_s = 2 + 0.1 * static_cast<double>(lines.size()), outcome.peak_rss_mb = 100;
    auto& metrics = outcome.result.metrics;
    const std::string command = line.command.front();
    if (command == "calibrate") metrics["rig_holdout_rms_px"] = 0.03;
    if (command == "pose2d")
      outcome.result.exit = kExitMissingTool, outcome.result.errors = {{"NET", "no net is there", "fetch"}};
    if (command == "mask") metrics["disagreement_with_hull"] = 0.12;
    if (command == "triangulate") metrics["holdout"]["median_px"] = 1.5;
    if (command == "tradeoff")
      metrics["trials"] = {
          {{"way", "pack"}, {"codec", "png"}, {"crops_per_s", 500.0}, {"bytes_per_crop", 2048}, {"exact", true}},
          {{"way", "pack"},
           {"codec", "jpeg:90"},
           {"crops_per_s", 2000.0},
           {"bytes_per_crop", 1024},
           {"exact", false},
           {"psnr_db", 20 * std::log10(255.0)}}};
    if (command == "avatar" && line.command[1] == "eval") metrics["holdout"]["ssim"] = 0.9;
    return outcome;
  }
};

FrontsReport RunPretended(const FrontsOptions& options, Pretended* pretended) {
  RunContext run;
  run.num_threads = 2, run.seed = 5;
  return RunFronts(
      options, [&](const CommandLine& line, const std::string&, const std::function<void()>&) { return (*pretended)(line); },
      run);
}

TEST(Fronts, EveryStageOfASessionIsMeasuredByItsOwnCommands) {
  const TempDir folder;
  PutSession(folder);
  FrontsOptions options;
  options.session = folder.path(), options.out = folder / "page/fronts.html";
  fs::create_directories(folder / "page");
  Pretended pretended;
  const FrontsReport report = RunPretended(options, &pretended);
  const std::vector<StageFront>& stages = report.fronts.stages;
  ASSERT_EQ(stages.size(), 6u);
  EXPECT_EQ(stages[0].ways[0].error, 0.03);
  EXPECT_THAT(stages[1].why_not, HasSubstr("no net is there"));
  EXPECT_EQ(stages[2].ways[0].error, 0.12) << "without true masks";
  EXPECT_EQ(stages[3].ways[0].error, 1.5);
  const FrontWay &png = stages[4].ways[1], &jpeg = stages[4].ways[4];
  EXPECT_NEAR(png.time(), 2, 1e-12) << "a thousand crops";
  EXPECT_EQ(png.error, 0);
  EXPECT_NEAR(jpeg.error, 1, 1e-12) << "levels, of the PSNR of one level";
  EXPECT_EQ(jpeg.stored_kib, 1);
  EXPECT_NEAR(stages[5].ways[0].error, 0.1, 1e-12);
  EXPECT_THAT(stages[5].ways[0].command, HasSubstr("--holdout-cameras b"));
  EXPECT_THAT(stages[0].ways[0].command, HasSubstr("calibrate --session " + folder.path() + " --holdout every:4"));
  for (const std::string& line : pretended.lines) EXPECT_THAT(line, HasSubstr("--threads 2 --seed 5"));
  EXPECT_FALSE(fs::exists(folder / "page/fronts.runs"));
  EXPECT_EQ(ReadFile(report.page), FrontsPage(report.fronts));
  EXPECT_EQ(FrontsJson(ReadFronts(report.results)), FrontsJson(report.fronts));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitOk);
  EXPECT_THAT(said.text, HasSubstr("pose2d: not measured, no net is there"));

  FrontsOptions again;
  again.from = report.results, again.out = folder / "page/again.html";
  EXPECT_EQ(ReadFile(RunPretended(again, &pretended).page), ReadFile(report.page));
}

TEST(Fronts, WhatASessionLacksIsSaidInOneLine) {
  const TempDir folder;
  PutSession(folder);
  fs::remove_all(folder / "dataset");
  FrontsOptions options;
  options.session = folder.path(), options.out = folder / "fronts.html", options.only = {"pack"};
  Pretended pretended;
  const FrontsReport report = RunPretended(options, &pretended);
  EXPECT_THAT(pretended.lines, IsEmpty());
  EXPECT_THAT(report.fronts.stages.at(0).why_not, HasSubstr("`mvstudio run SESSION` makes it"));
  const CommandResult said = Describe(report);
  EXPECT_EQ(said.exit, kExitIllPosed);
  EXPECT_EQ(said.errors.at(0).code, "TRD-NOTHING");
  options.only = {"packs"};
  EXPECT_THAT(MessageOf<UsageError>([&] { RunPretended(options, &pretended); }), HasSubstr("'packs' is none of calibrate"));
}

}  // namespace
}  // namespace mvstudio::stages
