#include "stages/nets/mask/budget.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "core/disk/output.h"
#include "core/disk/trace.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/quiet_run.h"

namespace mvstudio::stages {
namespace {

constexpr int kFewSteps = 3, kManySteps = 9;  // of the trial
constexpr int kLastStep = 300;                // a stretch behind it would cost its decoding

struct MaskSetting {
  size_t backend = 0;  ///< of those that there are
  bool coarse = false, hull = false;

  void Apply(MaskJob* job) const {
    constexpr int kCoarseSide = 160;  // px
    if (coarse) job->mask.coarse_side_px = kCoarseSide, job->mask.outline_px = 0;
    job->run.hull = hull;
  }
};

/// The cheapest first. What was given stays as it is.
std::vector<MaskSetting> FreeMasks(size_t num_backends, const MaskStageOptions& options) {
  const auto given = [&](const char* option) { return options.given.count(option) > 0; };
  const bool outline_given = given("mask-coarse-side") || given("mask-outline");
  std::vector<MaskSetting> settings;
  for (size_t b = 0; b < num_backends; ++b) {
    if (!outline_given) settings.push_back({b, true, options.run.hull});
    settings.push_back({b, false, options.run.hull});
    if (!options.run.hull && !given("hull")) settings.push_back({b, false, true});
  }
  return settings;
}

/// Time steps near the beginning that all cameras film, with people where joints say so; evenly, `count` at most. The last one
/// is always among them, so that the same footage is decoded whatever their number.
std::vector<int> TrialSteps(const MaskJob& job, int count) {
  std::vector<int> steps, with_people;
  for (const int frame : job.cameras[0].samples.all) {
    const int step = job.cameras[0].TimeStepOf(frame);
    const auto films = [&](const MaskCamera& camera) {
      const int own = camera.FrameAt(step);
      const bool asked = !camera.wanted || camera.wanted->count(own) > 0;
      return asked && std::binary_search(camera.samples.all.begin(), camera.samples.all.end(), own);
    };
    if (step < 0 || !std::all_of(job.cameras.begin(), job.cameras.end(), films)) continue;
    steps.push_back(step);
    if (job.cameras[0].bodies.At(frame)) with_people.push_back(step);
    if (static_cast<int>(steps.size()) >= kLastStep && !with_people.empty()) break;
  }
  const std::vector<int>& from = with_people.empty() ? steps : with_people;
  const int n = static_cast<int>(from.size()), k = std::min(count, n);
  std::vector<int> chosen;
  for (int i = 1; i <= k; ++i) chosen.push_back(from[static_cast<size_t>(static_cast<int64_t>(i) * n / k - 1)]);
  return chosen;
}

/// The job is that of a trial while this lives. (A copy would hold the sampled images twice.)
class TrialJob {
 public:
  TrialJob(const MaskSetting& setting, const std::vector<int>& steps, MaskJob* job)
      : job_(job), mask_(job->mask), run_(job->run), cache_(std::exchange(job->cache, {CachePlace::Kind::kOff, ""})) {
    setting.Apply(job);
    job->run.hull_frames = 0, job->run.sheet_tiles = 0;
    for (MaskCamera& camera : job->cameras) {
      wanted_.push_back(std::move(camera.wanted));
      camera.wanted.emplace();
      for (const int step : steps) camera.wanted->insert(camera.FrameAt(step));
    }
  }
  ~TrialJob() {
    job_->mask = mask_, job_->run = run_, job_->cache = cache_;
    for (size_t c = 0; c < wanted_.size(); ++c) job_->cameras[c].wanted = std::move(wanted_[c]);
  }
  TrialJob(const TrialJob&) = delete;
  TrialJob& operator=(const TrialJob&) = delete;

 private:
  MaskJob* job_;
  dataset::MaskOptions mask_;
  MaskRunOptions run_;
  CachePlace cache_;  ///< what is kept of an earlier trial would take no time
  std::vector<std::optional<std::set<int>>> wanted_;
};

/// Of the values that there are; NaN of none.
double MeanOfKnown(const std::vector<double>& values) {
  double sum = 0, count = 0;
  for (const double value : values)
    if (std::isfinite(value)) sum += value, ++count;
  return count > 0 ? sum / count : std::nan("");
}

int FramesToMask(const MaskJob& job) {
  int most = 0;
  for (const MaskCamera& camera : job.cameras) most = std::max(most, camera.num_wanted());
  return most;
}

/// How much of the footage is decoded for the trial.
double DecodedShare(const MaskJob& job, int last_step) {
  const std::vector<int>& all = job.cameras[0].samples.all;
  const auto end = std::upper_bound(all.begin(), all.end(), job.cameras[0].FrameAt(last_step));
  return static_cast<double>(end - all.begin()) / static_cast<double>(std::max<size_t>(1, all.size()));
}

class MaskBudget {
 public:
  MaskBudget(const std::vector<MaskBackend>& backends, const MaskStageOptions& options, const std::string& folder,
             double reading_s, const RunContext& run, MaskJob* job)
      : backends_(backends),
        options_(options),
        folder_(folder),
        reading_s_(reading_s),
        run_(run),
        quiet_(run),
        job_(*job),
        learned_(2 * backends.size()),
        settings_(FreeMasks(backends.size(), options)) {}

  void Try(BudgetReport* budget) {
    const double begin_s = options_.budget.NowSeconds();
    const auto target = options_.budget.Target();
    few_ = TrialSteps(job_, kFewSteps), many_ = TrialSteps(job_, kManySteps);
    if (many_.empty()) throw FormatError(job_.cameras[0].footage.path, "", "no time step is filmed by all cameras");
    ProgressStage stage(run_, "trial for the budget", static_cast<int64_t>(settings_.size()));
    for (const MaskSetting& setting : settings_) {
      const double before_s = options_.budget.NowSeconds();
      SettingTrial trial;
      if (target && AnyReaches(budget->trials, target->value)) {
        trial.why_not = kCheaperReaches;
        disagreements_.emplace_back();
      } else if (last_s_ > MostSeconds(*budget) - (before_s - begin_s)) {
        trial.why_not = "it would take too much of the time to try it";
        disagreements_.emplace_back();
      } else {
        trial = TryOne(setting);
        last_s_ = options_.budget.NowSeconds() - before_s;
      }
      Name(setting, &trial);
      budget->trials.push_back(std::move(trial));
      stage.Advance();
    }
    JudgeSpreads(budget);
    budget->trial_s = options_.budget.NowSeconds() - begin_s;
  }

  /// No backend can tell people from background.
  ChosenMasks Nobody() {
    const auto first = std::find_if(learned_.begin(), learned_.end(), [](const auto& learned) { return learned.has_value(); });
    return {{}, std::move(**first), backends_.front()};
  }

  std::vector<std::string> Reasons(const BudgetReport& budget) const {
    const size_t index = static_cast<size_t>(budget.choice.index);
    std::vector<std::string> reasons;
    for (size_t i = 0; i < settings_.size(); ++i) {
      const SettingTrial& trial = budget.trials[i];
      if (i == index) continue;
      reasons.push_back(trial.Name() + (trial.IsTried()
                                            ? " would take " + SecondsText(trial.predicted_s) +
                                                  (std::isfinite(trial.error) ? Format(" at %.3g %%", trial.error) : "")
                                            : " was not tried, " + trial.why_not));
    }
    return reasons;
  }

  ChosenMasks Chosen(const BudgetReport& budget) {
    const MaskSetting& setting = settings_[static_cast<size_t>(budget.choice.index)];
    setting.Apply(&job_);
    return {budget, std::move(*LearnedBy(setting)), backends_[setting.backend]};
  }

 private:
  /// A fifth of the budget; without one a quarter of what the quickest that was tried would take.
  double MostSeconds(const BudgetReport& budget) const {
    constexpr double kOfBudget = 0.2, kOfRun = 0.25;
    if (budget.trials.empty()) return std::numeric_limits<double>::infinity();
    const double budget_s = options_.budget.BudgetSeconds();
    if (std::isfinite(budget_s)) return kOfBudget * budget_s;
    double quickest_s = std::numeric_limits<double>::infinity();
    for (const SettingTrial& trial : budget.trials) {
      if (trial.IsTried()) quickest_s = std::min(quickest_s, ForetellSeconds(trial.parts, trial.size).value);
    }
    return kOfRun * quickest_s;
  }

  /// What is learned of the cameras depends on the outline that is asked for, and not on the hull.
  std::optional<MaskTrial>& LearnedBy(const MaskSetting& setting) { return learned_[2 * setting.backend + setting.coarse]; }
  MaskTrial Learn(const MaskSetting& setting) {
    const dataset::MaskOptions mask = job_.mask;
    const bool hull = job_.run.hull;
    setting.Apply(&job_);
    MaskTrial learned = TryBackend(job_, backends_[setting.backend], false, quiet_.context());
    job_.mask = mask, job_.run.hull = hull;
    return learned;
  }

  /// On few and on many time steps: what both share, and what each step costs.
  SettingTrial TryOne(const MaskSetting& setting) {
    SettingTrial trial;
    std::optional<MaskTrial>& learned = LearnedBy(setting);
    if (!learned) learned = Learn(setting);
    if (!learned->failed_camera.empty()) {
      trial.why_not = backends_[setting.backend].name + " cannot tell people from background in " + learned->failed_camera;
      disagreements_.emplace_back();
      return trial;
    }
    const double passes = setting.hull ? 2 : 1, decoded = DecodedShare(job_, many_.back());
    trial.size = FramesToMask(job_);
    trial.parts = {{"decoding", 1, {{1, std::max(1e-6, passes * reading_s_ * (1 - decoded))}}}, {"masks"}, {"hulls"}};
    trial.parts[2].most_size = job_.run.hull_frames;
    const ScratchFolder scratch(folder_);
    if (many_.size() > few_.size()) trial.parts[1].timings.push_back(Time(setting, few_, scratch.path()));
    trial.parts[1].timings.push_back(Time(setting, many_, scratch.path()));
    const double made_s = options_.budget.NowSeconds();
    std::vector<double> each = HullDisagreements(job_, scratch.path(), many_, quiet_.context());
    const double compared_s = options_.budget.NowSeconds() - made_s;
    trial.parts[2].timings.push_back({static_cast<double>(many_.size()), std::max(1e-6, compared_s)});
    if (job_.run.hull_frames == 0) trial.parts.pop_back();
    trial.error = 100 * MeanOfKnown(each);
    disagreements_.push_back(std::move(each));
    return trial;
  }

  SizedTiming Time(const MaskSetting& setting, const std::vector<int>& steps, const std::string& folder) {
    const double begin_s = options_.budget.NowSeconds();
    const TrialJob part(setting, steps, &job_);
    MakeMasks(job_, backends_[setting.backend], LearnedBy(setting)->models, folder, quiet_.context());
    return {static_cast<double>(steps.size()), std::max(1e-6, options_.budget.NowSeconds() - begin_s)};
  }

  /// All settings see the same time steps: what these have in common tells nothing between them.
  void JudgeSpreads(BudgetReport* budget) const {
    for (size_t s = 0; s < settings_.size(); ++s) {
      const std::vector<double>& own = disagreements_[s];
      std::vector<double> off;
      for (size_t i = 0; i < own.size(); ++i) {
        std::vector<double> of_step;
        for (const std::vector<double>& other : disagreements_)
          if (i < other.size()) of_step.push_back(other[i]);
        const double difference = 100 * (own[i] - MeanOfKnown(of_step));
        if (std::isfinite(difference)) off.push_back(difference);
      }
      if (off.size() < 2) continue;
      double squares = 0;
      const double mean = MeanOfKnown(off), n = static_cast<double>(off.size());
      for (const double d : off) squares += (d - mean) * (d - mean);
      budget->trials[s].error_sigma = std::sqrt(squares / (n - 1) / n);
    }
  }

  void Name(const MaskSetting& setting, SettingTrial* trial) const {
    if (backends_.size() > 1) trial->flags.emplace_back("backend", backends_[setting.backend].name);
    if (setting.coarse) trial->flags.insert(trial->flags.end(), {{"mask-coarse-side", "160"}, {"mask-outline", "0"}});
    if (setting.hull && !options_.run.hull) trial->flags.emplace_back("hull", "on");
  }

  const std::vector<MaskBackend>& backends_;
  const MaskStageOptions& options_;
  const std::string& folder_;
  const double reading_s_;
  const RunContext& run_;
  const QuietRun quiet_;
  MaskJob& job_;
  std::vector<std::optional<MaskTrial>> learned_;  ///< two of each backend, see LearnedBy
  const std::vector<MaskSetting> settings_;
  std::vector<int> few_, many_;
  std::vector<std::vector<double>> disagreements_;  ///< of each setting, by time step
  double last_s_ = 0;                               ///< that the last trial took
};

}  // namespace

ChosenMasks ChooseMasks(const std::vector<MaskBackend>& backends, const MaskStageOptions& options, const std::string& folder,
                        double started_s, double reading_s, const RunContext& run, MaskJob* job) {
  if (!job->has_calibration() || job->cameras.size() < 2)
    throw UsageError(
        "option 'budget' and option 'target' judge masks by how well cameras agree: give the footage of two cameras or more, "
        "and option 'calib'");
  BudgetReport budget;
  budget.stage = "mask", budget.asked = options.budget, budget.threads = ResolveThreads(run.num_threads);
  budget.unit = ErrorUnit::kPercent;
  budget.less_work = "fewer frames (option 'frames')", budget.better_data = "clean plates or a better calibration";
  budget.sizes = {{"frames", FramesToMask(*job)}, {"cameras", static_cast<double>(job->cameras.size())}};
  const UntracedScope untraced;
  MaskBudget trial(backends, options, folder, reading_s, run, job);
  trial.Try(&budget);
  const auto tried = [](const SettingTrial& t) { return t.IsTried(); };
  if (std::none_of(budget.trials.begin(), budget.trials.end(), tried)) return trial.Nobody();
  Choose(options.budget.NowSeconds() - started_s, &budget);
  budget.reasons = trial.Reasons(budget);
  return trial.Chosen(budget);
}

}  // namespace mvstudio::stages
