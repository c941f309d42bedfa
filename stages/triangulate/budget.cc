#include "stages/triangulate/budget.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <tuple>

#include "core/disk/output.h"
#include "core/disk/trace.h"
#include "core/parallel.h"
#include "core/quiet_run.h"
#include "core/random.h"
#include "stages/triangulate/solve.h"
#include "triangulate/take/cause.h"

namespace mvstudio::stages {
namespace {

/// The options that a trial may choose, from the cheapest setting to the dearest.
struct BudgetSetting {
  std::vector<std::pair<std::string, std::string>> flags;
  std::function<void(TriangulateOptions*)> apply;
};

std::vector<BudgetSetting> AllSettings() {
  const auto refine_on_few = [](TriangulateOptions* o) {
    o->refine = true, o->refinement.choice_frames = 60, o->refinement.choice_cameras = 3;
  };
  return {{{{"holdout-points", "500"}}, [](TriangulateOptions* o) { o->points.holdout_points = 500; }},
          {{}, [](TriangulateOptions*) {}},
          {{{"refine", "on"}, {"refine-choice-frames", "60"}, {"refine-choice-cameras", "3"}}, refine_on_few},
          {{{"refine", "on"}}, [](TriangulateOptions* o) { o->refine = true; }}};
}

/// Without those that change what was given. What was given is no part of a setting's name.
std::vector<BudgetSetting> FreeSettings(const TriangulateOptions& options) {
  const bool refines = options.refine;
  std::vector<BudgetSetting> free;
  for (BudgetSetting& setting : AllSettings()) {
    const bool refine = !setting.flags.empty() && setting.flags[0].first == "refine";
    if (refines && !refine) continue;  // refined with or without
    auto& flags = setting.flags;
    if (refines) flags.erase(flags.begin());
    const auto given = [&](const auto& flag) { return options.given.count(flag.first) > 0; };
    if (std::none_of(flags.begin(), flags.end(), given)) free.push_back(std::move(setting));
  }
  return free;
}

/// Held-out error of the points as they are written: by what refinement changed on its own held-out cameras.
triangulate::LeftOutFigures WrittenFigures(const TriangulateReport& report) {
  triangulate::LeftOutFigures figures = report.take.holdout.all;
  if (!report.refinement) return figures;
  const triangulate::LeftOutFigures &before = report.refinement->before, &after = report.refinement->after;
  const double factor = after.median_px / before.median_px;
  if (!std::isfinite(factor)) return figures;
  figures.median_px *= factor, figures.median_error_px *= factor, figures.median_sigmas = after.median_sigmas;
  return figures;
}

/// Error, and its standard error. A length is the median stated sigma, enlarged where held-out cameras show it to be too small.
std::pair<double, double> JudgedTake(const TriangulateReport& report, ErrorUnit unit) {
  const triangulate::LeftOutFigures figures = WrittenFigures(report);
  if (figures.num_samples == 0 || !std::isfinite(figures.median_px)) return {std::nan(""), 0};
  if (unit == ErrorUnit::kPx) return {figures.median_px, figures.median_error_px};
  const double expected_sigmas = std::sqrt(2 * std::log(2.0));
  const double error_mm = report.points.median_sigma_mm * std::max(1.0, figures.median_sigmas / expected_sigmas);
  return {error_mm, error_mm * figures.median_error_px / figures.median_px};
}

/// What was tried on a part of the take: the result, and the seconds of points and of checks.
struct TriedTake {
  TriangulateReport report;
  double points_s = 0, checks_s = 0;
};

/// All that is done with the take after it was read, on a part of it, into a folder that does not stay.
TriedTake TryTake(const PoseInput& input, const TriangulateReport& report, const BudgetSetting& setting,
                  const RunContext& run) {
  TriedTake tried;
  TriangulateReport& trial = tried.report;
  trial.options = report.options, trial.rig = report.rig, trial.skeleton = report.skeleton, trial.cameras = report.cameras;
  trial.options.trc.clear(), trial.options.truth.clear();
  setting.apply(&trial.options);
  const AtomicFolder scratch(report.options.out + "/budget-trial", false);
  trial.options.out = scratch.work_path();
  PointStatistics statistics(static_cast<int>(input.skeleton.joints.size()), input.limbs);
  const double begin_s = report.options.budget.NowSeconds();
  SolveWhole(input, run, &statistics, &trial);
  const double solved_s = report.options.budget.NowSeconds();
  JudgeTake(
      input, statistics, [&] { return input.frames; }, run, &trial);
  tried.points_s = solved_s - begin_s, tried.checks_s = report.options.budget.NowSeconds() - solved_s;
  return tried;
}

/// A part of the take on which settings are tried: one piece of it tells the time, four stretches the error. (Clocks and smooth
/// motions take longer the more frames follow upon each other.)
struct TrialPart {
  PoseInput input;
  bool is_piece = false;
};

PoseInput WithFrames(const PoseInput& input, std::vector<triangulate::DetectedFrame> frames) {
  PoseInput part;
  part.rig = input.rig, part.skeleton = input.skeleton, part.limbs = input.limbs, part.cameras = input.cameras;
  part.frames = std::move(frames);
  return part;
}

/// `count` frames in the middle.
std::vector<triangulate::DetectedFrame> MiddlePiece(const std::vector<triangulate::DetectedFrame>& frames, size_t count) {
  const auto begin = frames.begin() + static_cast<std::ptrdiff_t>((frames.size() - count) / 2);
  return {begin, begin + static_cast<std::ptrdiff_t>(count)};
}

std::vector<TrialPart> TrialParts(const PoseInput& input, uint64_t seed) {
  constexpr size_t kMostJudged = 260, kFewestFrames = 40, kChoiceFrames = 130;
  const size_t count = input.frames.size(), fewest = std::min(count, kFewestFrames);
  const size_t large = std::min(std::max(count / 3, fewest), triangulate::kMostClockFrames);
  const size_t small = std::max(large / 4, std::min(kChoiceFrames, large / 2));
  std::vector<TrialPart> parts;
  for (const size_t size : {small, large}) parts.push_back({WithFrames(input, MiddlePiece(input.frames, size)), true});
  const size_t judged = std::min(std::max(count / 4, fewest), kMostJudged);
  parts.push_back({WithFrames(input, StretchesOf(input.frames, judged, seed)), false});
  return parts;
}

}  // namespace

std::vector<triangulate::DetectedFrame> StretchesOf(const std::vector<triangulate::DetectedFrame>& frames, size_t count,
                                                    uint64_t seed) {
  constexpr size_t kStretches = 4;
  if (count >= frames.size()) return frames;
  Rng rng(seed);
  std::vector<triangulate::DetectedFrame> part;
  for (size_t k = 0; k < kStretches; ++k) {
    const size_t begin = k * frames.size() / kStretches, end = (k + 1) * frames.size() / kStretches;
    const size_t length = std::min((k + 1) * count / kStretches - k * count / kStretches, end - begin);
    const size_t first = begin + static_cast<size_t>(rng.Index(static_cast<int64_t>(end - begin - length + 1)));
    for (size_t i = first; i < first + length; ++i) part.push_back(frames[i]);
  }
  return part;
}

void ChooseWithinBudget(const PoseInput& input, double started_s, const RunContext& run, TriangulateReport* report) {
  constexpr double kTrialShare = 0.2;  // of the budget
  BudgetReport& budget = report->budget.emplace();
  budget.stage = "triangulate", budget.asked = report->options.budget;
  if (const auto wanted = budget.asked.Target()) budget.unit = wanted->unit;
  const double num_frames = static_cast<double>(input.frames.size());
  budget.sizes = {{"frames", num_frames}, {"cameras", static_cast<double>(input.cameras.size())}};
  budget.threads = ResolveThreads(run.num_threads);
  const std::vector<BudgetSetting> settings = FreeSettings(report->options);
  const std::vector<TrialPart> parts = TrialParts(input, run.seed);
  const double begin_s = budget.asked.NowSeconds(), most_s = kTrialShare * budget.asked.BudgetSeconds();
  const UntracedScope untraced;
  const QuietRun quiet(run);
  ProgressStage stage(run, "trial for the budget", static_cast<int64_t>(settings.size() * parts.size()));
  const auto target = budget.asked.Target();
  for (const BudgetSetting& setting : settings) {
    const bool reached = target && AnyReaches(budget.trials, target->value);
    SettingTrial& trial = budget.trials.emplace_back();
    trial.flags = setting.flags, trial.size = num_frames;
    if (budget.trials.size() > 1 && budget.asked.NowSeconds() - begin_s > most_s) {
      trial.why_not = "a fifth of the budget had gone into the trial";
      continue;
    }
    if (reached) {
      trial.why_not = kCheaperReaches;
      continue;
    }
    trial.parts = {{"points"}, {"checks", static_cast<double>(triangulate::kMostClockFrames)}};
    for (const TrialPart& part : parts) {
      const TriedTake tried = TryTake(part.input, *report, setting, quiet.context());
      const double frames = static_cast<double>(part.input.frames.size());
      if (part.is_piece) {
        trial.parts[0].timings.push_back({frames, tried.points_s}), trial.parts[1].timings.push_back({frames, tried.checks_s});
      } else {
        std::tie(trial.error, trial.error_sigma) = JudgedTake(tried.report, budget.unit);
      }
      stage.Advance();
    }
  }
  budget.trial_s = budget.asked.NowSeconds() - begin_s;
  Choose(budget.asked.NowSeconds() - started_s, &budget);
  settings[static_cast<size_t>(budget.choice.index)].apply(&report->options);
}

void KeepOutcome(double started_s, TriangulateReport* report) {
  BudgetReport& budget = *report->budget;
  budget.actual_error = JudgedTake(*report, budget.unit).first;
  budget.actual_s = budget.asked.NowSeconds() - started_s;
  KeepPrediction(budget, report->options.out);
}

}  // namespace mvstudio::stages
