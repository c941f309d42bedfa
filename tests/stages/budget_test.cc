#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/format.h"
#include "core/random.h"
#include "stages/budget/report.h"
#include "stages/pipeline/split_budget.h"
#include "stages/tradeoff/predictions.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

/// Words into budgets, timings into predictions, a front into a choice.
namespace mvstudio::stages {
namespace {

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
  EXPECT_DOUBLE_EQ(ParseTarget("12.5%", "target").value, 12.5);
  EXPECT_EQ(ParseTarget("12.5%", "target").unit, ErrorUnit::kPercent);
  EXPECT_NEAR(ParseTarget("0.85ssim", "target").value, 0.15, 1e-12) << "an error of 0.15";
  EXPECT_EQ(ParseTarget("0.85ssim", "target").unit, ErrorUnit::kSsim);
  for (const char* hostile : {"1ssim", "0ssim", "1.5ssim"}) EXPECT_THROW(ParseTarget(hostile, "target"), UsageError) << hostile;
  for (const char* hostile : {"", "1", "px", "0px", "-1mm", "1in", "1mm1mm", "1pxx", "nanpx", "1 px"})
    EXPECT_THROW(ParseTarget(hostile, "target"), UsageError) << hostile;
}

/// Closed forms: a line through two points; never a negative part of it. Residuals are relative.
TEST(Budget, TimeIsALineInSize) {
  const auto at = [](const std::vector<SizedTiming>& timings, double size) {
    return ForetellSeconds({{"", kInfinity, timings}}, size).value;
  };
  EXPECT_NEAR(at({{100, 2}, {300, 3}}, 0), 1.5, 1e-9);
  EXPECT_NEAR(at({{100, 2}, {300, 3}}, 1000), 6.5, 1e-9);
  EXPECT_NEAR(at({{1, 1}, {2, 2}, {3, 4}}, 1), 2.75 / 2.5625, 1e-9) << "below 0 at 0, so through the origin";
  EXPECT_NEAR(at({{100, 3}, {300, 2}}, 1e6), (1.0 / 3 + 1.0 / 2) / (1.0 / 9 + 1.0 / 4), 1e-9) << "time does not fall";
  EXPECT_NEAR(at({{50, 2}}, 100), 4, 1e-9);
  EXPECT_TRUE(std::isnan(at({}, 100)));
}

/// 0.4 s and 0.5 ms a frame of points, 0.2 s and 2 ms a frame of checks on 600 frames at most: both parts are found again from
/// stretches of half a thousand frames, of which a line through the sums makes three times too much.
TEST(Budget, PartsThatStopGrowingAreForetold) {
  WorkPart points{"points"}, checks{"checks", 600}, sum;
  for (const double frames : {130, 260, 520}) {
    points.timings.push_back({frames, 0.4 + 5e-4 * frames}), checks.timings.push_back({frames, 0.2 + 2e-3 * frames});
    sum.timings.push_back({frames, points.timings.back().seconds + checks.timings.back().seconds});
  }
  const double truth_s = 0.4 + 5e-4 * 10000 + 0.2 + 2e-3 * 600;
  const Foretold seconds = ForetellSeconds({points, checks}, 10000);
  EXPECT_NEAR(seconds.value, truth_s, 1e-9 * truth_s);
  EXPECT_GT(seconds.sigma, 0);
  EXPECT_LT(seconds.sigma, 0.2 * truth_s);
  EXPECT_GT(ForetellSeconds({sum}, 10000).value, 3 * truth_s);
}

/// Timings of a known line with 5 % of noise: the errors of what is foretold are as large as is said of them.
TEST(Budget, TheSpreadOfATimeIsWhatItComesOutWith) {
  constexpr int kDraws = 2000;
  constexpr double kTruth = 1 + 0.01 * 4000;
  Rng rng(7);
  double squares = 0, within = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    WorkPart part;
    for (const double size : {100, 200, 400}) part.timings.push_back({size, (1 + 0.01 * size) * (1 + 0.05 * rng.Normal())});
    const Foretold seconds = ForetellSeconds({part}, 4000);
    const double sigmas = (seconds.value - kTruth) / seconds.sigma;
    squares += sigmas * sigmas, within += std::abs(sigmas) < 1;
  }
  EXPECT_NEAR(std::sqrt(squares / kDraws), 1, 0.25);
  EXPECT_NEAR(within / kDraws, 0.68, 0.08);
}

/// 0.03 px that more boards do not lower, and 0.8 px over the root of their number.
TEST(Budget, AnErrorFallsWithTheDataToWhatItCannotLower) {
  std::vector<SizedError> errors;
  const auto truth = [](double size) { return std::sqrt(0.03 * 0.03 + 0.8 * 0.8 / size); };
  for (const double size : {8, 16, 32}) errors.push_back({size, truth(size)});
  EXPECT_NEAR(ForetellError(errors, 200).value, truth(200), 1e-9);
  EXPECT_GT(ForetellError(errors, 200).sigma, 0);
  errors[1].error = 0.25;
  EXPECT_EQ(ForetellError(errors, 16).value, 0.25) << "measured there";
  EXPECT_NEAR(ForetellError({{10, 0.2}}, 40).value, 0.2, 1e-12) << "one size promises no less for more";
  EXPECT_TRUE(std::isnan(ForetellError({{10, std::nan("")}}, 40).value));
}

SettingTrial TrialOf(double predicted_s, double error, double sigma) {
  SettingTrial trial;
  trial.parts.emplace_back(), trial.predicted_s = predicted_s, trial.error = error, trial.error_sigma = sigma;
  return trial;
}

TEST(Budget, ATargetThatIsReachedNeedsNoDearerTrial) {
  std::vector<SettingTrial> trials = {TrialOf(1, 3, 0.1), TrialOf(2, 2, 0.1)};
  EXPECT_TRUE(AnyReaches(trials, 2));
  EXPECT_FALSE(AnyReaches(trials, 1.9));
  EXPECT_FALSE(AnyReaches(trials, std::nan(""))) << "nobody asked for a target";
  trials[1].short_of = "too few boards";
  EXPECT_FALSE(AnyReaches(trials, 2));
  trials[0].error = std::nan("");
  EXPECT_FALSE(AnyReaches(trials, 100)) << "an error that could not be judged";
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

/// Of two settings, the better one may turn out too long.
TEST(Budget, ASpreadBeyondTheBudgetDoesNotFit) {
  std::vector<SettingTrial> trials = {TrialOf(5, 2, 0), TrialOf(9, 1, 0)};
  EXPECT_EQ(ChooseSetting(trials, 10, std::nan("")).index, 1);
  trials[1].predicted_sigma_s = 1.5;
  EXPECT_EQ(ChooseSetting(trials, 10, std::nan("")).index, 0);
}

/// What is as good, with less uncertainty, is worth its time; what falls short of something else reaches no target.
TEST(Budget, DoubtDecidesBetweenEqualErrors) {
  std::vector<SettingTrial> trials = {TrialOf(1, 2, 0), TrialOf(5, 2, 0)};
  EXPECT_EQ(ChooseSetting(trials, 10, std::nan("")).index, 0);
  trials[0].uncertainty = 0.4, trials[1].uncertainty = 0.2;
  EXPECT_EQ(ChooseSetting(trials, 10, std::nan("")).index, 1);
  EXPECT_EQ(ChooseSetting(trials, 10, 3).index, 0);
  trials[0].short_of = "too few boards";
  EXPECT_EQ(ChooseSetting(trials, 10, 3).index, 1);
}

TEST(Budget, WithoutAJudgeTheCheapestIsTaken) {
  const double unknown = std::nan("");
  EXPECT_EQ(ChooseSetting({TrialOf(2, unknown, 0), TrialOf(1, unknown, 0)}, 10, unknown).index, 1);
}

TEST(Budget, WhatNoSettingKeepsIsRefusedWithItsTime) {
  BudgetReport report;
  report.asked.budget = "1s";
  SettingTrial& trial = report.trials.emplace_back();
  trial.size = 100, trial.parts = {{"", kInfinity, {{10, 1}, {20, 1.5}}}};
  EXPECT_THAT(MessageOf<UsageError>([&] { Choose(2, &report); }), HasSubstr("predicted to take 7.5s"))
      << "2 + 0.5 + 0.05 * 100";
}

/// Of two that a trial cannot tell apart, the cheaper one is taken and is not called the best.
TEST(Budget, ATargetOutOfReachIsSaidOfWhatIsTaken) {
  BudgetReport report;
  report.asked.target = "1px", report.trials.resize(2);
  for (SettingTrial& trial : report.trials) trial.size = 100, trial.parts = {{"", kInfinity, {{10, 1}, {20, 1.5}}}};
  report.trials[1].size = 200, report.trials[0].error = 2, report.trials[0].error_sigma = 0.5;
  for (const auto& [error, words] : {std::pair(1.9, "no other that was tried"), std::pair(2.1, "the best of what was tried")}) {
    report.trials[1].error = error, report.trials[1].error_sigma = 0.5;
    Choose(2, &report);
    report.actual_error = 2, report.actual_s = 10;
    EXPECT_EQ(report.choice.index, 0);
    EXPECT_THAT(Describe(report).text, HasSubstr(words));
    EXPECT_THAT(Describe(report).warnings.at(0).text, HasSubstr("was out of reach: 2"));
  }
}

TEST(Budget, SecondsAreNoSurerThanTheStageSays) {
  BudgetReport report;
  SettingTrial& trial = report.trials.emplace_back();
  trial.size = 100, trial.parts = {{"", kInfinity, {{10, 1}, {20, 1.5}}}}, trial.error = 0.03;
  report.asked.budget = "1min";
  Choose(2, &report);
  const double own_s = trial.predicted_sigma_s;
  report.least_relative_sigma = 0.5 * own_s / 7.5;
  Choose(2, &report);
  EXPECT_DOUBLE_EQ(trial.predicted_sigma_s, own_s) << "the timings are less sure than that";
  report.asked.budget = Format("%.3fs", 7.5 + own_s + 0.5);
  Choose(2, &report);
  report.least_relative_sigma = (own_s + 1) / 7.5;
  EXPECT_THAT(MessageOf<UsageError>([&] { Choose(2, &report); }), HasSubstr("predicted to take 7.5s"));
  EXPECT_NEAR(trial.predicted_sigma_s, own_s + 1, 1e-9);
}

TEST(Budget, WhatComesOutWorseThanItWasForetoldIsSaid) {
  BudgetReport report;
  SettingTrial& trial = report.trials.emplace_back();
  trial.size = 100, trial.parts = {{"", kInfinity, {{10, 1}, {20, 1.5}}}}, trial.error = 0.03;
  report.asked.budget = "1min";
  Choose(2, &report);
  const auto codes = [&](double came_out) {
    report.actual_error = came_out;
    std::string all;
    for (const Notice& warning : Describe(report).warnings) all += warning.code;
    return all;
  };
  EXPECT_EQ(codes(0.04), "");
  EXPECT_EQ(codes(0.11), "BUD-PREDICTION");
  EXPECT_EQ(codes(std::nan("")), "") << "nothing was left to judge it by";
  report.actual_s = 61;
  EXPECT_EQ(codes(0.03), "BUD-LATE");
  EXPECT_THAT(Describe(report).warnings.at(0).text, HasSubstr("option 'budget' 1min is exceeded: it took 1min 1s, 7.5s was"));
  report.actual_s = 10, report.trial_s = 2;
  EXPECT_THAT(Describe(report).text, HasSubstr("a trial of 2.0s, 20 % of the time"));
  report.asked.target = "0.035px";
  Choose(2, &report);
  EXPECT_EQ(codes(0.034), "");
  EXPECT_EQ(codes(0.04), "BUD-TARGET");
  EXPECT_EQ(codes(std::nan("")), "BUD-TARGET");
}

/// 100 s, of which a timeline and a mask take 5 and 15: the rest as 10, 60 and 10 s were shared before.
TEST(SplitBudget, StagesShareWhatOthersLeave) {
  const double unknown = std::nan("");
  std::vector<StageTime> to_do = {{StageKind::kCalibrate, "calibrate", 10, false},
                                  {StageKind::kTimeline, "timeline walk", unknown, false},
                                  {StageKind::kPose2d, "pose2d walk", 60, false},
                                  {StageKind::kTriangulate, "triangulate walk", 10, false},
                                  {StageKind::kMask, "mask walk", 15, false}};
  EXPECT_DOUBLE_EQ(StageBudget(to_do, 100, "100s"), 10);
  to_do[0].seconds = unknown;
  EXPECT_DOUBLE_EQ(StageBudget(to_do, 100, "100s"), 80.0 / 8) << "one to six to one";
  to_do[2].has_own_budget = true;
  EXPECT_DOUBLE_EQ(StageBudget(to_do, 100, "100s"), 20.0 / 2) << "60 s of its own";
  to_do.erase(to_do.begin());
  EXPECT_TRUE(std::isnan(StageBudget(to_do, 90, "100s"))) << "a timeline takes no budget";
  to_do = {to_do[2], to_do[3]};
  EXPECT_DOUBLE_EQ(StageBudget(to_do, 30, "100s"), 15) << "the last one gets all that is left";
  EXPECT_THAT(MessageOf<UsageError>([&] { StageBudget(to_do, 10, "100s"); }),
              HasSubstr("nothing is left for triangulate walk"));
  to_do[1].seconds = unknown;
  EXPECT_THAT(MessageOf<UsageError>([&] { StageBudget(to_do, 30, "100s"); }), HasSubstr("how long mask walk takes"));
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
