#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/error.h"
#include "stages/budget/report.h"
#include "stages/tradeoff/predictions.h"
#include "tests/support/message_of.h"

/// Words into budgets, timings into predictions, a front into a choice.
namespace mvstudio::stages {
namespace {

using mvstudio::testing::MessageOf;
using ::testing::HasSubstr;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Budget, TimesHaveUnits) {
  EXPECT_DOUBLE_EQ(ParseSeconds("90s", "budget"), 90);
  EXPECT_DOUBLE_EQ(ParseSeconds("5min", "budget"), 300);
  EXPECT_DOUBLE_EQ(ParseSeconds("1h30min", "budget"), 5400);
  EXPECT_DOUBLE_EQ(ParseSeconds("1.5h", "budget"), 5400);
  EXPECT_DOUBLE_EQ(ParseSeconds("1min250ms", "budget"), 60.25);
  for (const char* hostile : {"", "5", "min", "-5min", "+5s", "0s", "5 min", "5min5", "5min1h", "5s5s", "1e3s", "nans", "infh",
                              "1.2.3s", ".s", "5MIN", "5min;", "\xff", "1h\n"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { ParseSeconds(hostile, "budget"); }), HasSubstr("option 'budget'")) << hostile;
  }
  EXPECT_THROW(ParseSeconds(std::string(400, '9') + "h", "budget"), UsageError);
}

TEST(Budget, TargetsHaveUnits) {
  EXPECT_DOUBLE_EQ(ParseTarget("0.2px", "target").value, 0.2);
  EXPECT_EQ(ParseTarget("0.2px", "target").unit, ErrorUnit::kPx);
  EXPECT_DOUBLE_EQ(ParseTarget("0.5cm", "target").value, 5);
  EXPECT_DOUBLE_EQ(ParseTarget("0.001m", "target").value, 1);
  for (const char* hostile : {"", "1", "px", "0px", "-1mm", "1in", "1mm1mm", "1pxx", "nanpx", "1 px"})
    EXPECT_THROW(ParseTarget(hostile, "target"), UsageError) << hostile;
}

/// Closed forms: a line through two points; never a negative part of it.
TEST(Budget, TimeIsALineInSize) {
  const TimeModel line = FitTime({{100, 2}, {300, 3}});
  EXPECT_NEAR(line.fixed_s, 1.5, 1e-12);
  EXPECT_NEAR(line.per_unit_s, 0.005, 1e-12);
  EXPECT_NEAR(line.At(1000), 6.5, 1e-12);
  EXPECT_NEAR(FitTime({{1, 1}, {2, 2}, {3, 4}}).per_unit_s, 17.0 / 14, 1e-12) << "below 0 at 0, so through the origin";
  const TimeModel falling = FitTime({{100, 3}, {300, 2}});
  EXPECT_DOUBLE_EQ(falling.per_unit_s, 0);
  EXPECT_DOUBLE_EQ(falling.At(1e6), 2.5);
  EXPECT_DOUBLE_EQ(FitTime({{50, 2}}).At(100), 4);
  EXPECT_TRUE(std::isnan(FitTime({}).At(100)));
}

SettingTrial TrialOf(double predicted_s, double error, double sigma) {
  SettingTrial trial;
  trial.timings = {{1, predicted_s}}, trial.predicted_s = predicted_s, trial.error = error, trial.error_sigma = sigma;
  return trial;
}

TEST(Budget, TheChoiceOnASmallFront) {
  const std::vector<SettingTrial> trials = {TrialOf(1, 3.0, 0.03), TrialOf(2, 2.99, 0.03), TrialOf(4, 2.5, 0.03),
                                            TrialOf(8, 2.49, 0.03), SettingTrial()};
  using Outcome = SettingChoice::Outcome;
  const auto expect = [&](double budget_s, double target, Outcome outcome, int index) {
    const SettingChoice choice = ChooseSetting(trials, budget_s, target);
    EXPECT_EQ(choice.outcome, outcome) << budget_s << " " << target;
    EXPECT_EQ(choice.index, index) << budget_s << " " << target;
  };
  expect(100, std::nan(""), Outcome::kReached, 2);  // the third is as good as the fourth, at less time
  expect(3, std::nan(""), Outcome::kReached, 0);    // so is the first as the second
  expect(0.5, std::nan(""), Outcome::kNothingFits, 0);
  expect(kInfinity, 2.995, Outcome::kReached, 1);
  expect(kInfinity, 2.495, Outcome::kReached, 3);
  expect(5, 2.0, Outcome::kBestWithinBudget, 2);
  expect(kInfinity, 1.0, Outcome::kBestWithinBudget, 2);
}

TEST(Budget, WithoutAJudgeTheCheapestIsTaken) {
  const double unknown = std::nan("");
  EXPECT_EQ(ChooseSetting({TrialOf(2, unknown, 0), TrialOf(1, unknown, 0)}, 10, unknown).index, 1);
}

TEST(Budget, WhatNoSettingKeepsIsRefusedWithItsTime) {
  BudgetReport report;
  report.asked.budget = "1s", report.size = 100;
  report.trials.emplace_back().timings = {{10, 1}, {20, 1.5}};
  EXPECT_THAT(MessageOf<UsageError>([&] { Choose(2, &report); }), HasSubstr("predicted to take 7.5s"))
      << "2 + 0.5 + 0.05 * 100";
}

TEST(Predictions, TheWorstRatioIsFarthestFromOne) {
  const RatioFigures figures = FiguresOfRatios({1.1, 0.5, 1.9, 1.0, std::nan(""), 0}, 0.15);
  EXPECT_EQ(figures.num, 4);
  EXPECT_EQ(figures.num_within, 2);
  EXPECT_DOUBLE_EQ(figures.worst, 0.5);
  EXPECT_DOUBLE_EQ(figures.median, 1.1);
}

}  // namespace
}  // namespace mvstudio::stages
