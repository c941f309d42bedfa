#include "stages/nets/pose2d/budget.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/disk/trace.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/quiet_run.h"
#include "stages/nets/pose2d/existing.h"
#include "stages/people/pose2d_quality.h"

namespace mvstudio::stages {
namespace {

constexpr detect::PoseQuality kQualities[] = {detect::PoseQuality::kFast, detect::PoseQuality::kBalanced,
                                              detect::PoseQuality::kExact};

struct NetSetting {
  std::string backend;
  detect::PoseQuality quality = detect::PoseQuality::kBalanced;
  int every = 1;
};

/// Crops that the net looks at for a person, with which its time grows.
double CropsOf(detect::PoseQuality quality) {
  const detect::CropPlan plan = detect::PlanOf(quality);
  return static_cast<double>(plan.scales.size()) * (plan.mirror ? 2 : 1);
}

/// What nobody gave, the cheapest first.
std::vector<NetSetting> FreeNets(const Pose2dOptions& options) {
  const bool given = options.given.count("quality") > 0 || options.pose.quality != detect::PoseOptions().quality;
  std::vector<std::string> names = {options.backend};
  if (options.backend == "auto") names = InstalledPoseBackends(options.models);
  std::vector<NetSetting> settings;
  for (const detect::PoseQuality quality : kQualities) {
    if (given && quality != options.pose.quality) continue;
    for (const std::string& name : names) settings.push_back({name, quality, options.every});
  }
  return settings;
}

/// A stretch after the beginning, as long as from one search for people to the next: so each counts for its share.
DetectJob StretchJob(const DetectJob& job, int num_frames) {
  constexpr int kMostPassed = 300, kFewest = 8;
  DetectJob stretch = job;
  stretch.overlays = 0, stretch.cache.kind = CachePlace::Kind::kOff;
  const int length = std::max(kFewest, std::min(job.options.redetect_frames, num_frames / 3));
  if (job.frames.empty()) {
    stretch.first = std::min(num_frames / 3, kMostPassed), stretch.max_frames = length;
    return stretch;
  }
  const size_t count = job.frames.size(), begin = count / 3;
  const size_t end = std::min(count, begin + static_cast<size_t>(length));
  stretch.frames.assign(job.frames.begin() + static_cast<std::ptrdiff_t>(begin),
                        job.frames.begin() + static_cast<std::ptrdiff_t>(end));
  return stretch;
}

/// Time steps that are to be looked at; of footage that does not say its length a stretch is taken to be a tenth.
int FramesToDo(const DetectJob& job) {
  constexpr int kUnknown = 300;
  if (!job.frames.empty()) return static_cast<int>(job.frames.size());
  int longest = 0;
  for (const dataset::CameraFootage& footage : job.footage) longest = std::max(longest, FramesOf(footage));
  return longest > 0 ? longest : kUnknown;
}

/// Cameras are done side by side, as many at a time as there are threads.
double Rounds(size_t cameras, int num_threads) {
  const double threads = ResolveThreads(num_threads);
  return std::ceil(static_cast<double>(cameras) / threads) / static_cast<double>(cameras);
}

SettingTrial TryNet(const DetectJob& stretch, const geometry::Rig& rig, const NetSetting& setting, int num_frames,
                    const Pose2dOptions& options, const RunContext& run) {
  const PoseBackend backend = OpenPoseBackend(setting.backend, options.models, setting.quality, options.onnx);
  const std::vector<CameraPoses> cameras = DetectPoses(stretch, backend, run);
  std::vector<dataset::Pose2dTrack> tracks;
  double looked_at = 0, read_s = 0, detect_s = 0;
  for (const CameraPoses& camera : cameras) {
    tracks.push_back(camera.track);
    looked_at += camera.frames, read_s += camera.read_s, detect_s += camera.seconds;
  }
  const double count = static_cast<double>(cameras.size()), rounds = Rounds(cameras.size(), run.num_threads);
  SettingTrial trial;
  trial.size = static_cast<double>(num_frames) / setting.every;
  if (looked_at == 0) {
    trial.why_not = "the stretch of the trial has no frames";
    return trial;
  }
  const double frames = looked_at / count;
  trial.parts = {{"reading", 1, {{1, rounds * read_s * num_frames / frames}}}};
  trial.parts.push_back({"keypoints", static_cast<double>(num_frames), {{frames, rounds * detect_s}}});
  const PoseAgreement agreement = MeasureAgreement(tracks, backend.net->skeleton(), rig, options.pose.max_persons, run);
  if (agreement.measured) trial.error = agreement.median_px, trial.error_sigma = agreement.all.median_error_px;
  return trial;
}

SettingTrial Named(SettingTrial trial, const NetSetting& setting, const Pose2dOptions& options) {
  trial.flags.clear();
  if (options.backend == "auto") trial.flags.emplace_back("backend", setting.backend);
  if (options.given.count("quality") == 0) trial.flags.emplace_back("quality", std::string(ToString(setting.quality)));
  if (setting.every != options.every) trial.flags.emplace_back("every", std::to_string(setting.every));
  if (setting.every > 1) trial.what = "frames between have no keypoints";
  return trial;
}

/// Qualities that cannot be tried within what is left for the trial are left out, as their crops foretell it.
void TryNets(const DetectJob& stretch, const geometry::Rig& rig, const Pose2dOptions& options, int num_frames, double most_s,
             const RunContext& run, std::vector<NetSetting>* settings, BudgetReport* budget) {
  const double begin_s = budget->asked.NowSeconds();
  std::map<std::string, double> crop_s;  // of the stretch
  ProgressStage stage(run, "trial for the budget", static_cast<int64_t>(settings->size()));
  const QuietRun quiet(run);
  const auto target = budget->asked.Target();
  double enough_s = std::numeric_limits<double>::infinity();  // that a setting took in the trial which reaches the target
  for (const NetSetting& setting : *settings) {
    const double before_s = budget->asked.NowSeconds(), left_s = most_s - (before_s - begin_s);
    const auto known = crop_s.find(setting.backend);
    const double crops = CropsOf(setting.quality);
    SettingTrial trial;
    if (known != crop_s.end() && known->second * crops >= enough_s) {
      trial.why_not = kCheaperReaches;
    } else if (!budget->trials.empty() && (left_s < 0 || (known != crop_s.end() && known->second * crops > left_s))) {
      trial.why_not = "it would take more than a fifth of the budget to try it";
    } else {
      trial = TryNet(stretch, rig, setting, num_frames, options, quiet.context());
      crop_s[setting.backend] = (budget->asked.NowSeconds() - before_s) / crops;
      if (target && trial.error <= target->value) enough_s = std::min(enough_s, crop_s[setting.backend] * crops);
    }
    budget->trials.push_back(Named(std::move(trial), setting, options));
    stage.Advance();
  }
}

/// Where nothing is quick enough, the fewest frames are left out that make it so.
void ThinFrames(const Pose2dOptions& options, double elapsed_s, int num_frames, std::vector<NetSetting>* settings,
                BudgetReport* budget) {
  constexpr int kMostEvery = 16;
  const double most_s = budget->asked.BudgetSeconds();
  const auto fits = [&](const SettingTrial& trial) {
    const Foretold seconds = ForetellSeconds(trial.parts, trial.size);
    return trial.IsTried() && elapsed_s + seconds.value + seconds.sigma <= most_s;
  };
  if (options.given.count("every") > 0 || options.every != 1) return;
  const size_t count = settings->size();
  for (int every = 1; every <= kMostEvery; every *= 2) {
    std::vector<SettingTrial> thinned(budget->trials.begin(), budget->trials.begin() + static_cast<std::ptrdiff_t>(count));
    for (SettingTrial& trial : thinned) trial.size = static_cast<double>(num_frames) / every;
    if (std::none_of(thinned.begin(), thinned.end(), fits)) continue;
    for (size_t i = 0; every > 1 && i < count; ++i) {
      if (!thinned[i].IsTried()) continue;
      NetSetting setting = (*settings)[i];
      setting.every = every;
      budget->trials.push_back(Named(thinned[i], setting, options));
      settings->push_back(setting);
    }
    return;
  }
}

std::vector<std::string> ReasonsForNet(const std::vector<NetSetting>& settings, const BudgetReport& budget) {
  const NetSetting& chosen = settings[static_cast<size_t>(budget.choice.index)];
  std::vector<std::string> reasons;
  const auto compare = [&](const std::string& option, const auto& is_other) {
    for (size_t i = 0; i < settings.size(); ++i) {
      const SettingTrial& trial = budget.trials[i];
      if (settings[i].every != chosen.every || !is_other(settings[i])) continue;
      const std::string other = option == "backend" ? settings[i].backend : std::string(ToString(settings[i].quality));
      std::string text = "option '" + option + "': " + other + " was not tried, " + trial.why_not;
      if (trial.IsTried())
        text = "option '" + option + "': " + other + " would take " + SecondsText(trial.predicted_s) +
               (std::isfinite(trial.error) ? Format(" at %.3g px", trial.error) : "");
      reasons.push_back(text);
    }
  };
  compare("backend", [&](const NetSetting& s) { return s.backend != chosen.backend && s.quality == chosen.quality; });
  compare("quality", [&](const NetSetting& s) { return s.backend == chosen.backend && s.quality != chosen.quality; });
  if (chosen.every > 1) reasons.push_back("option 'every': no setting is quick enough for more frames");
  return reasons;
}

}  // namespace

BudgetReport ChooseNet(const DetectJob& job, const geometry::Rig& rig, double started_s, const RunContext& run,
                       Pose2dOptions* options) {
  constexpr double kTrialShare = 0.2;  // of the budget
  if (rig.cameras.size() < 2 || job.footage.size() < 2)
    throw UsageError(
        "option 'budget' and option 'target' judge keypoints by how well cameras agree: give the footage of two "
        "cameras or more, and option 'calib'");
  BudgetReport budget;
  budget.stage = "pose2d", budget.asked = options->budget, budget.threads = ResolveThreads(run.num_threads);
  const auto target = budget.asked.Target();
  if (target && target->unit != ErrorUnit::kPx)
    throw UsageError("option 'target' " + budget.asked.target + ": keypoints have errors in px");
  budget.less_work = "fewer frames (option 'frames')", budget.better_data = "a better calibration or larger images";
  const UntracedScope untraced;
  const int num_frames = FramesToDo(job);
  budget.sizes = {{"frames", num_frames}, {"cameras", static_cast<double>(job.footage.size())}};
  std::vector<NetSetting> settings = FreeNets(*options);
  const double begin_s = budget.asked.NowSeconds(), most_s = kTrialShare * budget.asked.BudgetSeconds();
  TryNets(StretchJob(job, num_frames), rig, *options, num_frames, most_s, run, &settings, &budget);
  budget.trial_s = budget.asked.NowSeconds() - begin_s;
  const double elapsed_s = budget.asked.NowSeconds() - started_s;
  ThinFrames(*options, elapsed_s, num_frames, &settings, &budget);
  Choose(elapsed_s, &budget);
  budget.reasons = ReasonsForNet(settings, budget);
  const NetSetting& chosen = settings[static_cast<size_t>(budget.choice.index)];
  options->backend = chosen.backend, options->pose.quality = chosen.quality, options->every = chosen.every;
  return budget;
}

}  // namespace mvstudio::stages
