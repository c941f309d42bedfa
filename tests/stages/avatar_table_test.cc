#include "stages/study/avatar_table.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

using report::Value;

constexpr char kBoth[] = "held-out cameras in held-out frames", kMotion[] = "training cameras in held-out frames";

struct RunSpec {
  std::string folder, method = "tna", seed = "1";
  double ssim = 0.5;
  std::vector<std::string> cameras{"00_00", "00_01"};
  std::string width = "8", device = "cpu", images = "digest", label = {};
};

Value SplitOf(double ssim) { return Value::Object().Set("ssim", ssim); }

ScoredRun MakeRun(const RunSpec& spec) {
  ScoredRun run;
  run.folder = spec.folder, run.label = spec.label;
  Value cameras = Value::Array();
  for (const std::string& name : spec.cameras) cameras.Append(name);
  const Value options = Value::Object()
                            .Set("model.method", spec.method)
                            .Set("model.width", spec.width)
                            .Set("train.device", spec.device)
                            .Set("seed", spec.seed);
  const Value distance = Value::Object().Set("name", "FD (gabor)").Set("value", 10 * spec.ssim);
  run.metrics = Value::Object()
                    .Set("training", Value::Object().Set("options", options).Set("cameras", cameras).Set("size_px", 64))
                    .Set("holdout", SplitOf(spec.ssim).Set("kind", kBoth).Set("fd", distance).Set("psnr_db", 20.0))
                    .Set("other_splits", Value::Object().Set(kMotion, SplitOf(0.75)))
                    .Set("baselines", Value::Object().Set("mean_image", SplitOf(0.25)));
  run.protocol.splits = Value::Object().Set(kMotion, Value::Object().Set("sha256", spec.images));
  return run;
}

std::vector<std::string> NamesOf(const Comparison& comparison) {
  std::vector<std::string> names;
  for (const ComparisonRow& row : comparison.rows) names.push_back(row.name);
  return names;
}

TEST(AvatarTable, SpreadHasItsClosedForm) {
  const double none = std::nan(""), infinite = std::numeric_limits<double>::infinity();
  const Spread spread = SpreadOf({none, 1, 4, infinite, 2});
  EXPECT_EQ(spread.n, 3);
  EXPECT_NEAR(spread.mean, 7.0 / 3, 1e-15);
  EXPECT_EQ(spread.half_range, 1.5);
  EXPECT_NEAR(spread.sd, std::sqrt(7.0 / 3), 1e-15);  // (16 + 1 + 25) / 9 / 2
  EXPECT_EQ(spread.least, 1);
  EXPECT_EQ(spread.most, 4);
  const Spread one = SpreadOf({5});
  EXPECT_EQ(one.mean, 5);
  EXPECT_EQ(one.half_range, 0);
  EXPECT_TRUE(std::isnan(one.sd));
  const Spread nothing = SpreadOf({none});
  EXPECT_EQ(nothing.n, 0);
  EXPECT_TRUE(std::isnan(nothing.mean) && std::isnan(nothing.least));
}

/// A run that tells what it cost, beside a fitted body with this SSIM.
ScoredRun Costly(const RunSpec& spec, double seconds_per_frame, double train_s, double body_ssim) {
  ScoredRun run = MakeRun(spec);
  run.metrics.Set("seconds_per_frame", seconds_per_frame);
  run.metrics.Set("baselines", Value::Object().Set("body_alone", SplitOf(body_ssim)));
  run.timing = Value::Object().Set("peak_rss_mb", 300.0);
  run.train = Value::Object()
                  .Set("metrics", Value::Object().Set("wall_s", train_s))
                  .Set("timing", Value::Object().Set("peak_rss_mb", 500.0));
  return run;
}

TEST(AvatarTable, CostsAreOfTheRunsThatTellThem) {
  const std::vector<ScoredRun> runs = {Costly({"r/g1", "gaussians", "1", 0.8}, 0.01, 30, 0.7),
                                       Costly({"r/g2", "gaussians", "2", 0.8}, 0.02, 50, 0.7),
                                       MakeRun({"r/t", "tna", "1", 0.7})};
  const Comparison comparison = CompareRuns(runs, false);
  ASSERT_EQ(comparison.rows.size(), 2u);
  EXPECT_EQ(comparison.rows[0].name, "Gaussians");
  const Costs& costs = comparison.rows[0].costs;
  EXPECT_EQ(costs.at("frames_per_s").mean, 75);
  EXPECT_EQ(costs.at("frames_per_s").half_range, 25);
  EXPECT_EQ(costs.at("train_s").mean, 40);
  EXPECT_EQ(costs.at("train_rss_mb").mean, 500);
  EXPECT_EQ(costs.at("eval_rss_mb").mean, 300);
  EXPECT_EQ(costs.count("num_parameters"), 0u);
  EXPECT_TRUE(comparison.rows[1].costs.empty());
  EXPECT_THAT(TextTable(comparison), HasSubstr("frames/s"));
  EXPECT_THAT(TextTable(comparison), Not(HasSubstr("parameters")));
  EXPECT_THAT(TextTable(CompareRuns({MakeRun({"r/t", "tna", "1", 0.7})}, false)), Not(HasSubstr("frames/s")));
  // What is no cost is left out: no clock, an unfinished training.
  const Comparison odd = CompareRuns({Costly({"r/g", "gaussians"}, std::nan(""), 0, 0.7)}, false);
  EXPECT_EQ(odd.rows[0].costs.count("frames_per_s") + odd.rows[0].costs.count("train_s"), 0u);
}

TEST(AvatarTable, ARunWithoutANetworkIsCalledByWhatItIs) {
  ScoredRun body = MakeRun({"r/t", "tna", "1", 0.7}), network = MakeRun({"r/u", "tna", "1", 0.8});
  for (ScoredRun* run : {&body, &network}) {
    Value training = run->metrics["training"];
    training.Set("num_parameters", 3908288.0);
    run->metrics.Set("training", training).Set("checkpoint_step", run == &body ? 0.0 : 500.0);
  }
  const Comparison comparison = CompareRuns({body, network}, false);
  ASSERT_EQ(comparison.rows.size(), 2u);
  for (const ComparisonRow& row : comparison.rows) {
    const bool is_body = row.folders.at(0) == "r/t";
    EXPECT_EQ(row.name, is_body ? "Textured body" : "TNA");
    EXPECT_EQ(row.costs.count("num_parameters"), is_body ? 0u : 1u);
  }
}

TEST(AvatarTable, EachFittedBodyIsARowOfItsOwn) {
  const auto names = [](double first, double second) {
    return NamesOf(CompareRuns({Costly({"r/a", "gaussians"}, 1, 1, first), Costly({"r/b", "tna"}, 1, 1, second)}, true));
  };
  EXPECT_THAT(names(0.7, 0.7), ElementsAre("Gaussians", "TNA", "fitted body"));
  EXPECT_THAT(names(0.8, 0.7), ElementsAre("Gaussians", "TNA", "fitted body, of b", "fitted body, of a"));
}

TEST(AvatarTable, SeedsShareARowAndTheSpreadDecides) {
  const auto compare = [](double worst_of_first) {
    return CompareRuns({MakeRun({"r/a1", "tna", "1", worst_of_first}), MakeRun({"r/d1", "direct", "1", 0.85}),
                        MakeRun({"r/a2", "tna", "2", 0.92}), MakeRun({"r/d2", "direct", "2", 0.87})},
                       false);
  };
  const Comparison comparison = compare(0.90);
  EXPECT_THAT(NamesOf(comparison), ElementsAre("TNA", "Direct"));
  EXPECT_EQ(comparison.primary, kBoth);
  EXPECT_EQ(comparison.distance_name, "FD (gabor)");
  EXPECT_THAT(comparison.rows[0].folders, ElementsAre("r/a1", "r/a2"));
  EXPECT_THAT(comparison.rows[0].seeds, ElementsAre("1", "2"));
  EXPECT_NEAR(comparison.rows[0].splits.at(kBoth).values.at("ssim").mean, 0.91, 1e-12);
  EXPECT_NEAR(comparison.rows[0].splits.at(kBoth).values.at("fd").mean, 9.1, 1e-12);
  EXPECT_EQ(comparison.rows[1].splits.at(kMotion).values.at("ssim").mean, 0.75);
  ASSERT_EQ(comparison.differences.size(), 1u);
  EXPECT_EQ(comparison.differences[0].row, "TNA");
  EXPECT_EQ(comparison.differences[0].against, "Direct");
  EXPECT_NEAR(comparison.differences[0].ssim, 0.05, 1e-12);
  EXPECT_TRUE(comparison.differences[0].spread_known);
  EXPECT_TRUE(comparison.differences[0].outside_spread);
  EXPECT_FALSE(compare(0.86).differences[0].outside_spread) << "0.86 … 0.92 and 0.85 … 0.87 overlap";
  const Comparison single = CompareRuns({MakeRun({"a", "tna", "1", 0.9}), MakeRun({"d", "direct", "1", 0.1})}, false);
  EXPECT_FALSE(single.differences[0].spread_known || single.differences[0].outside_spread);
}

TEST(AvatarTable, NamesTellRowsOfOneMethodApart) {
  RunSpec narrow{"a"}, wide{"b"}, elsewhere{"c"};
  wide.width = "16", elsewhere.device = "cuda", elsewhere.seed = "2";
  EXPECT_THAT(NamesOf(CompareRuns({MakeRun(narrow), MakeRun(wide), MakeRun(elsewhere)}, false)),
              ElementsAre("TNA, width 8", "TNA, width 16"));
  RunSpec three{"a"}, two{"b"}, others{"c"};
  three.cameras = {"00_00", "00_01", "00_02"}, others.cameras = {"00_03", "00_04"};
  EXPECT_THAT(NamesOf(CompareRuns({MakeRun(three), MakeRun(two)}, false)), ElementsAre("TNA, 3 cameras", "TNA, 2 cameras"));
  EXPECT_THAT(NamesOf(CompareRuns({MakeRun(two), MakeRun(others)}, false)),
              ElementsAre("TNA, cameras 00_00+00_01", "TNA, cameras 00_03+00_04"));
  narrow.label = wide.label = "ours";
  EXPECT_THAT(NamesOf(CompareRuns({MakeRun(narrow), MakeRun(wide)}, false)), ElementsAre("ours")) << "the label decides";
  RunSpec unknown{"u", "mine"};
  EXPECT_THAT(NamesOf(CompareRuns({MakeRun(unknown)}, true)), ElementsAre("mine", "mean image"));
}

TEST(AvatarTable, SplitsOfOtherImagesAreMarked) {
  RunSpec first{"a"}, second{"b", "direct"};
  second.images = "others";
  const Comparison comparison = CompareRuns({MakeRun(first), MakeRun(second)}, false);
  EXPECT_THAT(comparison.mixed_splits, ElementsAre(kMotion));
  EXPECT_TRUE(comparison.rows[0].splits.at(kMotion).same_images);
  EXPECT_FALSE(comparison.rows[1].splits.at(kMotion).same_images);
  EXPECT_TRUE(comparison.rows[1].splits.at(kBoth).same_images);
  const std::string marked = MarkdownTable(comparison), plain = MarkdownTable(CompareRuns({MakeRun(first)}, false));
  EXPECT_THAT(marked, HasSubstr("| Direct | 1 | 0.7500 \u2020 |"));
  EXPECT_THAT(plain, Not(HasSubstr("\u2020")));
}

TEST(AvatarTable, MarkdownAndTextHaveTheSameColumns) {
  const Comparison comparison = CompareRuns(
      {MakeRun({"a1", "tna", "1", 0.90}), MakeRun({"a2", "tna", "2", 0.92}), MakeRun({"d", "direct", "1", 0.5})}, true);
  std::istringstream markdown(MarkdownTable(comparison));
  std::vector<std::string> lines;
  for (std::string line; std::getline(markdown, line) && !line.empty();) lines.push_back(line);
  ASSERT_EQ(lines.size(), 5u);
  EXPECT_EQ(lines[0], "| method | runs | motion held out: SSIM | both held out: SSIM | FD (gabor) | PSNR, dB |");
  EXPECT_EQ(lines[1], "|---|---:|---:|---:|---:|---:|");
  EXPECT_EQ(lines[2], "| TNA | 2 | 0.7500 \u00b1 0.0000 | 0.9100 \u00b1 0.0100 | 9.10 \u00b1 0.10 | 20.00 \u00b1 0.00 |");
  EXPECT_EQ(lines[3], "| Direct | 1 | 0.7500 | 0.5000 | 5.00 | 20.00 |");
  EXPECT_EQ(lines[4], "| mean image | \u2013 | \u2013 | 0.2500 | \u2013 | \u2013 |");
  std::istringstream text(TextTable(comparison));
  std::vector<long> widths;
  for (std::string line; std::getline(text, line) && widths.size() < 4;) {
    widths.push_back(std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xc0) != 0x80; }));
  }
  EXPECT_EQ(widths, std::vector<long>(4, widths[0])) << TextTable(comparison);
}

TEST(AvatarTable, StudiesGoToTheRowsThatTheyName) {
  Comparison comparison = CompareRuns({MakeRun({"runs/a", "tna", "1", 0.9}), MakeRun({"runs/d", "direct", "1", 0.5})}, false);
  report::StudyAnswers answers;
  answers.study = "s", answers.rater = "Ann", answers.methods = {"TNA", "d"};  // a row's name, a run's folder
  for (const bool first : {true, true, true, false}) answers.answers.push_back({"p", first, false, 1});
  report::StudyAnswers foreign = answers;
  foreign.study = "t", foreign.methods = {"direct", "somebody"};
  EXPECT_THAT(AddStudies({answers, foreign}, &comparison), ElementsAre("somebody"));
  ASSERT_EQ(comparison.rows[0].study.size(), 1u);
  ASSERT_EQ(comparison.rows[1].study.size(), 2u);
  const StudyCell &own = comparison.rows[0].study[0], &other = comparison.rows[1].study[0];
  EXPECT_EQ(own.against, "Direct");
  EXPECT_EQ(other.against, "TNA");
  EXPECT_EQ(own.share, 0.75);
  EXPECT_EQ(other.share, 0.25);
  EXPECT_EQ(own.n, 4);
  EXPECT_EQ(own.raters, 1);
  EXPECT_NEAR(own.p_value, 10.0 / 16, 1e-15);  // 2 (4 + 1) / 2^4
  EXPECT_NEAR(other.low, 1 - own.high, 1e-12);
  EXPECT_NEAR(other.high, 1 - own.low, 1e-12);
  EXPECT_EQ(comparison.rows[1].study[1].against, "somebody");
  EXPECT_THAT(MarkdownTable(comparison), HasSubstr("75 % against Direct ["));
}

}  // namespace
}  // namespace mvstudio::stages
