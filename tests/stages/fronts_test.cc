#include <cmath>
#include <filesystem>
#include <fstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "stages/fronts/run.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// What stages cost and how far off they are, on commands that are only pretended.
namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

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
  fronts.grown = "a small studio";
  fronts.growth = {{"mask", "frames", {1, 4, 16}, {1, 2, 6}, {100, 101, 99}, {5, 4, 3}}, {"pack", "frames", {}, {}, {}, {}}};
  fronts.growth[1].why_not = "no dataset is there";
  for (GrowthRow& row : fronts.growth) FinishGrowth(&row);
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

TEST(Fronts, TheExponentIsThatOfTheTimeAboveItsStart) {
  const std::vector<double> factors = {1, 4, 16};
  const auto of = [&](double start, double per_one, double k) {
    std::vector<double> seconds;
    for (const double n : factors) seconds.push_back(start + per_one * std::pow(n, k));
    return GrowthExponent(factors, seconds);
  };
  for (const double k : {0.5, 1.0, 1.5, 3.0}) EXPECT_NEAR(of(2, 0.3, k), k, 1e-12);
  EXPECT_TRUE(std::isnan(of(2, 0.001, 1))) << "noise";
  EXPECT_NEAR(GrowthExponent({1, 4}, {1, 16}), 2, 1e-12);
  EXPECT_TRUE(std::isnan(GrowthExponent({1, 4, 16}, {1, 0.5, 3}))) << "it shrinks on the way";
  EXPECT_TRUE(std::isnan(GrowthExponent({1}, {1})));
}

TEST(Fronts, GrowthAboveLinearHasItsReasonOrSaysThatNoneIsKnown) {
  GrowthRow row{"calibrate", "cameras", {1, 4, 16}, {1, 8, 64}, {1, 1, 1}, {1, 1, 1}};
  FinishGrowth(&row);
  EXPECT_TRUE(row.WorseThanLinear());
  EXPECT_THAT(row.reason, HasSubstr("one dense system"));
  row.axis = "frames";
  FinishGrowth(&row);
  EXPECT_EQ(row.reason, "no reason is known");
  GrowthRow linear{"calibrate", "frames", {1, 4, 16}, {1, 4, 16}, {1, 1, 1}, {1, 1, 1}};
  FinishGrowth(&linear);
  EXPECT_NEAR(linear.exponent, 1, 1e-12);
  EXPECT_THAT(linear.reason, IsEmpty());
}

/// A session with all that the stages need, and one take.
void PutSession(const fs::path& folder) {
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
    fs::create_directories((folder / path).parent_path());
    std::ofstream(folder / path) << "{}";
  }
}

/// Answers as the commands do; nets are not installed.
struct Pretended {
  std::vector<std::string> lines;
  double frames = 0;  ///< of the last studio that was made

  static std::string After(const CommandLine& line, const std::string& name) {
    for (const LineOption& option : line.options)
      if (option.name == name) return option.values.at(0);
    return "";
  }

  CallOutcome operator()(const CommandLine& line) {
    lines.push_back(line.Text());
    CallOutcome outcome;
    outcome.seconds = 3, outcome.cpu_s = 2 + 0.1 * static_cast<double>(lines.size()), outcome.peak_rss_mb = 100;
    auto& metrics = outcome.result.metrics;
    const std::string command = line.command.front();
    if (command == "synth") {
      frames = std::stod(After(line, "take-frames"));
      WriteFileAtomic(After(line, "out") + "/ours.txt", std::string());
      PutSession(After(line, "out"));
    }
    if (command == "mask") outcome.cpu_s = 1 + 1e-3 * frames * frames;
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
  PutSession(folder.path());
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

TEST(Fronts, StudiosGrowAndStagesWithThem) {
  const TempDir folder;
  FrontsOptions options;
  options.out = folder / "fronts.html", options.only = {"mask"};
  Pretended pretended;
  const FrontsReport report = RunPretended(options, &pretended);
  ASSERT_EQ(report.fronts.growth.size(), 3u);
  for (const GrowthRow& row : report.fronts.growth) {
    EXPECT_EQ(row.stage, "mask");
    EXPECT_THAT(row.factors, ElementsAre(1, 4, 16));
    EXPECT_EQ(std::isfinite(row.exponent), row.axis == "frames") << row.axis;
    if (row.axis != "frames") continue;
    EXPECT_NEAR(row.exponent, 2, 1e-9);
    EXPECT_EQ(row.reason, "no reason is known");
  }
  EXPECT_THAT(Describe(report).text, HasSubstr("mask         frames     2.00 no reason is known"));
  EXPECT_THAT(ReadFile(report.page), HasSubstr("times as many"));
  EXPECT_FALSE(fs::exists(folder / "fronts.runs"));
}

/// A program of the user's: a shell script that prints what it was called with.
TEST(Fronts, PeersAreWaysOfTheProgramThatWasGiven) {
  const TempDir folder;
  PutSession(folder.path());
  std::ofstream(folder / "peers.sh") << R"(#!/bin/sh
for word in "$@"; do case $word in out=*) echo kept >"${word#out=}/own.txt";; esac; done
[ "$1" = mask ] || { printf 'Traceback\nknows masks alone\n' >&2; exit 3; }
echo '[{"name": "other program", "command": "'"$*"'", "processor_seconds": 0.5, "error": 0.05},
       {"name": "absent", "why_not": "it is not installed"}]'
)";
  fs::permissions(folder / "peers.sh", fs::perms::owner_all);
  FrontsOptions options;
  options.session = folder.path(), options.out = folder / "fronts.html", options.only = {"mask", "triangulate"};
  options.peers = folder / "peers.sh";
  Pretended pretended;
  const FrontsReport report = RunPretended(options, &pretended);
  const std::vector<FrontWay>& masks = report.fronts.stages.at(0).ways;
  const FrontWay &other = masks.at(masks.size() - 2), &absent = masks.back();
  EXPECT_EQ(other.mark, WayMark::kPeer);
  EXPECT_TRUE(other.time_front);
  EXPECT_THAT(other.command, HasSubstr("mask session=" + folder.path() + " take=walk calib="));
  EXPECT_EQ(absent.why_not, "it is not installed");
  EXPECT_THAT(report.fronts.stages.at(1).ways.back().why_not, HasSubstr("ended with 3: knows masks alone"));
  EXPECT_THAT(report.fronts.growth, IsEmpty()) << "a session is as large as it is";
  EXPECT_FALSE(fs::exists(folder / "fronts.runs")) << "nor what the program wrote there";
  options.peers = folder / "none.sh", options.only = {"mask"};
  const FrontsReport without = RunPretended(options, &pretended);
  EXPECT_EQ(without.fronts.stages.at(0).ways.size(), masks.size() - 1);
  EXPECT_THAT(without.fronts.stages.at(0).ways.back().why_not, HasSubstr("none.sh"));
  EXPECT_FALSE(fs::exists(folder / "fronts.runs"));
}

TEST(Fronts, WhatASessionLacksIsSaidInOneLine) {
  const TempDir folder;
  PutSession(folder.path());
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
