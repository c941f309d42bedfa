#include "stages/nets/train/budget.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/choice/heldout_choice.h"
#include "core/disk/trace.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/quiet_run.h"
#include "core/statistics.h"

namespace mvstudio::stages {
namespace {

constexpr int kJudged = 24;  // validation images
/// Predicted seconds are never surer than that. Timings of short trainings agree by chance, and a long one meets what they
/// cannot know: a clock that falls, caches, other programs. Whole runs were up to 6 % off (docs/notes/budgets.md).
constexpr double kLeastRelativeSigma = 0.05;
constexpr int kNetworkSteps = 600, kGaussianSteps = 1500;

/// A way to make an avatar, the simpler ones first. Textured networks are not among them: they have added less than 0.01 of
/// SSIM to the fitted body.
struct AvatarKind {
  avatar::Method method = avatar::Method::kTna;
  int steps = 0;
  std::string why_not = {};  ///< the options do not fit it

  bool IsBody() const { return steps == 0; }
  std::string Name() const { return IsBody() ? "the fitted body alone" : std::string(ToString(method)); }
};

AvatarTrainOptions OptionsOf(const AvatarTrainOptions& given, const AvatarKind& kind, int steps) {
  AvatarTrainOptions options = given;
  options.model.method = kind.method, options.train.steps = steps;
  options.given.insert({"method", "steps"});
  if (kind.IsBody()) options.train.init_steps = 0;
  return options;
}

/// What nobody gave. Throws the last refusal where the options fit none.
std::vector<AvatarKind> FreeKinds(const AvatarTrainOptions& options) {
  const auto steps_of = [&](avatar::Method method) {
    if (options.Given("steps")) return options.train.steps;
    return method == avatar::Method::kGaussians ? kGaussianSteps : kNetworkSteps;
  };
  std::vector<AvatarKind> kinds;
  if (options.Given("method")) {
    kinds = {{options.model.method, steps_of(options.model.method)}};
  } else {
    kinds = {{avatar::Method::kTna, 0}};
    for (const avatar::Method method : {avatar::Method::kGaussians, avatar::Method::kDirect, avatar::Method::kHf})
      kinds.push_back({method, steps_of(method)});
  }
  bool any = false;
  for (AvatarKind& kind : kinds) {
    const AvatarTrainOptions of_kind = OptionsOf(options, kind, kind.steps);
    try {
      MakeMethod(of_kind);
      any = true;
    } catch (const UsageError& refusal) {
      kind.why_not = refusal.what();
    }
  }
  if (!any) throw UsageError(kinds.back().why_not);
  return kinds;
}

/// Evenly spread time steps with about `images` images; all of them for networks with memory.
std::vector<int> SomeFrames(const avatar::RunConfig& config, int images, bool memory) {
  const std::vector<int>& all = config.split.train_frames;
  const size_t cameras = std::max<size_t>(1, config.split.train_cameras.size());
  const size_t count = std::clamp<size_t>(static_cast<size_t>(images) / cameras, std::min<size_t>(4, all.size()), all.size());
  if (memory) return all;
  std::vector<int> some;
  for (size_t i = 0; i < count; ++i) some.push_back(all[(2 * i + 1) * all.size() / (2 * count)]);
  return some;
}

/// Per image, 1 - SSIM.
std::vector<double> LossesOf(const std::vector<double>& ssim) {
  std::vector<double> losses;
  for (const double s : ssim) losses.push_back(1 - s);
  return losses;
}

class AvatarTrials {
 public:
  AvatarTrials(const dataset::PanopticDataset& data, const avatar::RunConfig& config, const AvatarTrainOptions& options,
               double started_s, const RunContext& run)
      : data_(data),
        config_(config),
        options_(options),
        started_s_(started_s),
        end_s_(started_s + options.budget.BudgetSeconds()),
        run_(run),
        quiet_(run),
        kinds_(FreeKinds(options)) {}

  void Try(BudgetReport* budget) {
    const double begin_s = Now();
    const auto target = options_.budget.Target();
    ProgressStage stage(run_, "trial for the budget", static_cast<int64_t>(kinds_.size()));
    for (const AvatarKind& kind : kinds_) {
      stage.Advance(0, kind.Name());
      if (!kind.why_not.empty()) {
        Skip(kind, kind.why_not, budget);
      } else if (target && AnyReaches(budget->trials, target->value)) {
        Skip(kind, kCheaperReaches, budget);
      } else if (!budget->trials.empty() && Now() + RestOfBest(*budget) > end_s_) {
        Skip(kind, "no time is left to try it", budget);
      } else {
        TryKind(kind, budget);
      }
      stage.Advance();
    }
    JudgeSpreads(budget);
    budget->trial_s = Now() - begin_s;
  }

  const AvatarKind& KindOf(int trial) const { return kinds_[of_trial_[static_cast<size_t>(trial)]]; }
  int StepsOf(int trial) const { return steps_[static_cast<size_t>(trial)]; }

  std::vector<std::string> Reasons(const BudgetReport& budget) const {
    std::vector<std::string> reasons;
    for (size_t i = 0; i < budget.trials.size(); ++i) {
      const SettingTrial& trial = budget.trials[i];
      if (static_cast<int>(i) == budget.choice.index) continue;
      reasons.push_back(trial.Name() + (trial.IsTried() ? " would take " + SecondsText(trial.predicted_s) +
                                                              Format(" at SSIM %.4f", 1 - trial.error)
                                                        : " was not tried, " + trial.why_not));
    }
    return reasons;
  }

 private:
  double Now() const { return options_.budget.NowSeconds(); }

  void Add(const AvatarKind& kind, int steps, SettingTrial trial, std::vector<double> losses, BudgetReport* budget) {
    trial.flags = {{"method", std::string(ToString(kind.method))}, {"steps", std::to_string(steps)}};
    if (kind.IsBody()) trial.what = kind.Name();
    trial.uncertainty = static_cast<double>(&kind - kinds_.data());  // how far from the simplest
    budget->trials.push_back(std::move(trial));
    losses_.push_back(std::move(losses)), steps_.push_back(steps);
    of_trial_.push_back(static_cast<size_t>(&kind - kinds_.data()));
  }

  void Skip(const AvatarKind& kind, const std::string& why, BudgetReport* budget) {
    SettingTrial trial;
    trial.why_not = why;
    Add(kind, kind.steps, std::move(trial), {}, budget);
  }

  /// On part of the images, as the kind wants them.
  MethodTrial Learn(const AvatarKind& kind, int steps, const avatar::RunConfig& config, const RunPacks& packs) const {
    const AvatarTrainOptions options = OptionsOf(options_, kind, steps);
    return MakeMethod(options)->Try(config, packs, quiet_.context());
  }

  /// What making the crops of all images costs beside those of some.
  WorkPart CropsPart(const RunPacks& packs, double seconds) const {
    const double watched = packs.watched ? static_cast<double>(packs.watched->size()) : 0;
    const double all = static_cast<double>(config_.split.train_cameras.size() * config_.split.train_frames.size());
    return {"crops", 1, {{1, std::max(1e-6, seconds * (all + watched) / (static_cast<double>(packs.train.size()) + watched))}}};
  }

  void TryKind(const AvatarKind& kind, BudgetReport* budget) {
    constexpr int kImages = 120;
    const double begin_s = Now();
    const AvatarTrainOptions options = OptionsOf(options_, kind, kind.steps);
    const auto method = MakeMethod(options);
    avatar::RunConfig config = config_;
    method->Prepare(&config);
    config.split.train_frames = SomeFrames(config, kImages, kind.method == avatar::Method::kV2v);
    const RunPacks packs = BuildPacks(data_, method->model, method->train, quiet_.context(), &config);
    const double crops_s = Now() - begin_s;
    std::vector<WorkPart> parts = {CropsPart(packs, crops_s)};
    if (kind.IsBody()) {
      TryBody(kind, config, packs, std::move(parts), budget);
    } else {
      TrySteps(kind, config, packs, std::move(parts), budget);
    }
  }

  /// What the best that still fits would take from here on; 0 of none.
  double RestOfBest(const BudgetReport& budget) const {
    double best = std::numeric_limits<double>::infinity(), rest_s = 0;
    for (const SettingTrial& trial : budget.trials) {
      if (!trial.IsTried() || !(trial.error < best)) continue;
      const Foretold seconds = ForetellSeconds(trial.parts, trial.size);
      const double sure_s = kLeastRelativeSigma * (Now() - started_s_ + seconds.value);
      const double most_s = seconds.value + std::max(seconds.sigma, sure_s);  // as Choose sees it
      if (Now() + most_s <= end_s_) best = trial.error, rest_s = most_s;
    }
    return rest_s;
  }

  void TryBody(const AvatarKind& kind, const avatar::RunConfig& config, const RunPacks& packs, std::vector<WorkPart> parts,
               BudgetReport* budget) {
    const MethodTrial learned = Learn(kind, 0, config, packs);
    SettingTrial trial;
    trial.size = 1, trial.parts = std::move(parts);
    trial.parts.push_back({"colours", 1, {{1, std::max(1e-6, learned.seconds + learned.scoring_s)}}});
    const std::vector<double> losses = LossesOf(learned.ssim);
    trial.error = Mean(losses);
    Add(kind, 0, std::move(trial), losses, budget);
  }

  /// Two short trainings tell what a step costs and what more of them bring; two of a few steps, whether there is time for
  /// that.
  void TrySteps(const AvatarKind& kind, const avatar::RunConfig& config, const RunPacks& packs, std::vector<WorkPart> parts,
                BudgetReport* budget) {
    const int some = std::max(1, kind.steps / 12), more = std::max(2, kind.steps / 4);
    WorkPart first{"steps"};
    for (const int steps : {1, 4})
      first.timings.push_back({double(steps), std::max(1e-6, Learn(kind, steps, config, packs).seconds)});
    const double needs_s = ForetellSeconds({first}, some).value + ForetellSeconds({first}, more).value;
    const double own_s = ForetellSeconds(parts, 1).value + ForetellSeconds({first}, more).value;
    if (Now() + needs_s + std::max(own_s, RestOfBest(*budget)) > end_s_)
      return Skip(kind, "to try it would take " + SecondsText(needs_s) + ", which leaves too little to train", budget);
    WorkPart training{"steps"};
    std::vector<SizedError> errors;
    MethodTrial learned;
    for (const int steps : {some, more}) {
      learned = Learn(kind, steps, config, packs);
      training.timings.push_back({double(steps), std::max(1e-6, learned.seconds)});
      errors.push_back({double(steps), Mean(LossesOf(learned.ssim))});
    }
    const double checks = 2 + kind.steps / std::max(1, options_.train.save_every);
    parts.push_back({"scores", 1, {{1, std::max(1e-6, checks * learned.scoring_s)}}}), parts.push_back(training);
    for (const int steps : {more, kind.steps}) {
      if (steps == more && options_.Given("steps")) continue;
      SettingTrial trial;
      trial.size = steps, trial.parts = parts, trial.error = ForetellError(errors, steps).value;
      Add(kind, steps, std::move(trial), LossesOf(learned.ssim), budget);
    }
  }

  /// A standard error of what each loses against the best on the same images.
  void JudgeSpreads(BudgetReport* budget) const {
    std::vector<SettingTrial>& trials = budget->trials;
    size_t best = trials.size();
    for (size_t i = 0; i < trials.size(); ++i) {
      if (trials[i].IsTried() && (best == trials.size() || trials[i].error < trials[best].error)) best = i;
    }
    for (size_t i = 0; i < trials.size(); ++i) {
      if (trials[i].IsTried()) trials[i].error_sigma = DifferenceOverUnits(losses_[i], losses_[best]).standard_error;
    }
  }

  const dataset::PanopticDataset& data_;
  const avatar::RunConfig& config_;
  const AvatarTrainOptions& options_;
  const double started_s_, end_s_;
  const RunContext& run_;
  const QuietRun quiet_;
  const std::vector<AvatarKind> kinds_;
  std::vector<std::vector<double>> losses_;  ///< of each trial
  std::vector<int> steps_;
  std::vector<size_t> of_trial_;  ///< the kind
};

void LogPlan(const AvatarTrainOptions& options) {
  const std::string asked = options.budget.budget.empty() ? options.budget.target : options.budget.budget;
  Log(LogLevel::kInfo,
      asked + ": a body is fitted; then its colours" +
          (options.Given("method") ? " and " + std::string(ToString(options.model.method)) : ", gaussians, direct and hf") +
          " are tried on validation images, as far as there is time; the simplest that none is shown to beat "
          "is trained");
}

}  // namespace

void CheckAvatarBudget(const AvatarTrainOptions& options) {
  (void)options.budget.BudgetSeconds();
  const std::optional<ErrorTarget> target = options.budget.Target();
  if (target && target->unit != ErrorUnit::kSsim)
    throw UsageError("option 'target' " + options.budget.target + ": avatars have their SSIM on held-out images: 0.85ssim");
  if (!options.budget.Asked()) return;
  const char* what = "option 'budget' and option 'target' ";
  for (const char* option : {"ranks", "rank", "world-size", "rendezvous", "init-from", "iuv"})
    if (options.Given(option))
      throw UsageError(what + ("choose for one process that begins anew: leave option '" + std::string(option) + "' out"));
  if (options.fit != BodyFitMode::kAuto) throw UsageError(std::string(what) + "need a body that is fitted: option 'fit' auto");
  if (options.train.validate_images == 0)
    throw UsageError(std::string(what) + "need validation images: leave option 'validate-pictures' out");
  FreeKinds(options);
}

void LeaveJudgeOut(const dataset::PanopticDataset& data, AvatarTrainOptions* options) {
  if (!options->Given("validate-pictures")) options->train.validate_images = kJudged;
  if (!options->Given("least-gain")) options->train.least_gain = 0;  // the body is among what is chosen from
  const int person = avatar::ChoosePerson(data, options->pack.person);
  const avatar::DatasetSplit split = SplitOf(data, person, options->split);
  if (split.validation_cameras.empty()) {
    if (split.train_cameras.size() < 2)
      throw UsageError(
          "option 'budget' and option 'target' judge on a camera that is not trained on, and there is one camera to train on: "
          "leave them out and choose by option 'method'");
    if (!options->body.empty())
      throw UsageError(
          "option 'body' with option 'budget' or option 'target': give option 'validate-camera', which the body was "
          "fitted without");
    options->split.validate_camera = split.train_cameras[split.train_cameras.size() / 2];
    Log(LogLevel::kInfo,
        "camera " + options->split.validate_camera + " judges and is not trained on (option 'validate-camera' names another)");
  }
  LogPlan(*options);
}

void RequireTimeToFit(const dataset::PanopticDataset& data, const avatar::RunConfig& config, const AvatarTrainOptions& options,
                      double started_s, const RunContext& run) {
  const double budget_s = options.budget.BudgetSeconds();
  if (!std::isfinite(budget_s) || !options.body.empty()) return;
  const double all = static_cast<double>(config.split.train_frames.size());
  constexpr int kFrames = 4;
  if (all < 4 * kFrames) return;  // a trial would cost as much
  avatar::DatasetSplit split = config.split;
  split.train_frames = SomeFrames(config, kFrames * static_cast<int>(split.train_cameras.size()), false);
  split.validation_frames = split.holdout_frames = split.train_frames;
  avatar::PersonFitOptions fit;
  fit.templates = TemplatesOf(options.body_template);
  const QuietRun quiet(run);
  const double begin_s = options.budget.NowSeconds();
  (void)FitToSplit(data, split, config.pack.person, config.pack.pose_by, fit, quiet.context());
  const double now_s = options.budget.NowSeconds(), fit_s = now_s - begin_s;
  // Of its time a part does not grow with the time steps, so that a quarter in proportion is sure to be needed.
  const double least_s = now_s - started_s + fit_s * all / kFrames / 4;
  if (least_s > budget_s)
    throw UsageError("option 'budget' " + options.budget.budget + ": fitting the body alone is predicted to take more than " +
                     SecondsText(least_s) + "; give more time, or fewer frames (option 'frames')");
}

BudgetReport ChooseAvatar(const dataset::PanopticDataset& data, const avatar::RunConfig& config, double started_s,
                          const RunContext& run, AvatarTrainOptions* options) {
  BudgetReport budget;
  budget.stage = "avatar train", budget.asked = options->budget, budget.threads = ResolveThreads(run.num_threads);
  budget.unit = ErrorUnit::kSsim;
  budget.least_relative_sigma = kLeastRelativeSigma;
  budget.better_data = "a better calibration, better masks or more cameras";
  budget.sizes = {{"frames", static_cast<double>(config.split.train_frames.size())},
                  {"cameras", static_cast<double>(config.split.train_cameras.size())},
                  {"pixels", static_cast<double>(config.pack.size_px) * config.pack.size_px}};
  const UntracedScope untraced;
  AvatarTrials trials(data, config, *options, started_s, run);
  trials.Try(&budget);
  Choose(options->budget.NowSeconds() - started_s, &budget);
  budget.reasons = trials.Reasons(budget);
  *options = OptionsOf(*options, trials.KindOf(budget.choice.index), trials.StepsOf(budget.choice.index));
  return budget;
}

void KeepAvatarBudget(double started_s, AvatarTrainReport* report) {
  BudgetReport& budget = *report->budget;
  budget.actual_error = Mean(LossesOf(report->judged_ssim));
  budget.actual_s = budget.asked.NowSeconds() - started_s;
  KeepPrediction(budget, report->folder);
}

}  // namespace mvstudio::stages
