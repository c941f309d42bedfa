#include "triangulate/take/cause.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "core/choice/heldout_choice.h"
#include "core/format.h"
#include "triangulate/sync/sync.h"
#include "triangulate/take/cause_fit.h"
#include "triangulate/take/cause_trials.h"

namespace mvstudio::triangulate {
namespace {

using internal::Assumption;
using internal::FitFrames;
using internal::FrameFit;
using internal::Judge;

constexpr double kSigmaOfDiagonal = 0.005;
constexpr double kAlike = 1.03;
constexpr double kWellCarried = 0.9;  // frame rates differ where less of the take fits
constexpr double kMaxRatio = 0.7, kMinErrors = 4, kMinCarried = 0.5;
// A camera that nothing fitted fits: where the rig itself is off by many pixels, the mean residual falls by less.
constexpr double kRegained = 0.15, kNearlyAll = 0.9;

double SigmaPx(const geometry::Rig& rig, const CauseOptions& options) {
  if (options.sigma_px > 0) return options.sigma_px;
  double sum = 0;
  for (const auto& camera : rig.cameras) sum += std::hypot(camera.camera.width_px, camera.camera.height_px);
  return kSigmaOfDiagonal * sum / static_cast<double>(rig.cameras.size());
}

FrameFit Sum(const std::vector<FrameFit>& fits) {
  FrameFit sum;
  for (const FrameFit& fit : fits) {
    sum.offered += fit.offered, sum.carried += fit.carried, sum.cost_px += fit.cost_px;
    sum.upright += fit.upright, sum.mirrored += fit.mirrored;
  }
  return sum;
}

void SetFigures(const std::vector<FrameFit>& fits, CauseTrial* trial) {
  const FrameFit sum = Sum(fits);
  const double offered = std::max(sum.offered, 1);
  trial->num_detections = sum.offered;
  trial->carried = sum.carried / offered;
  trial->residual_px = sum.cost_px / offered;
  trial->mirrors_people = sum.mirrored > 4 * sum.upright;
}

/// By how many standard errors the mean residual of a frame falls, with frames that are the same in both or others.
double GainInErrors(const std::vector<FrameFit>& given, const std::vector<FrameFit>& tried, bool same_frames) {
  std::vector<double> before, after;
  for (const FrameFit& fit : given) before.push_back(fit.cost_px / std::max(fit.offered, 1));
  for (const FrameFit& fit : tried) after.push_back(fit.cost_px / std::max(fit.offered, 1));
  return InStandardErrors(same_frames ? DifferenceOverUnits(before, after)
                                      : DifferenceOfMeans(MeanOverUnits(before), MeanOverUnits(after)));
}

/// The cameras with the most detections, in the rig's order.
std::vector<size_t> BusiestCameras(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, int max_cameras) {
  std::vector<size_t> count(rig.cameras.size(), 0), order(rig.cameras.size());
  for (const DetectedFrame& frame : frames) {
    for (size_t c = 0; c < frame.people.size(); ++c) count[c] += !frame.people[c].empty();
  }
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return count[a] > count[b]; });
  while (!order.empty() && (order.size() > static_cast<size_t>(max_cameras) || count[order.back()] == 0)) order.pop_back();
  std::sort(order.begin(), order.end());
  return order;
}

/// A take of some of the cameras alone. Where these are all, the frames are the caller's.
struct Take {
  geometry::Rig rig;
  std::vector<DetectedFrame> fewer;
  const std::vector<DetectedFrame>* given = nullptr;

  const std::vector<DetectedFrame>& frames() const { return given ? *given : fewer; }
};

Take WithCameras(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const std::vector<size_t>& cameras) {
  Take take;
  for (const size_t c : cameras) take.rig.cameras.push_back(rig.cameras[c]);
  if (cameras.size() == rig.cameras.size()) {
    take.given = &frames;
    return take;
  }
  for (const DetectedFrame& frame : frames) {
    DetectedFrame& own = take.fewer.emplace_back();
    own.frame = frame.frame;
    for (const size_t c : cameras) own.people.push_back(frame.people[c]);
  }
  return take;
}

/// Every fourth frame of a sample chooses, the others give the figures.
struct Sample {
  std::vector<DetectedFrame> choose, judge;
};

Sample Draw(const std::vector<DetectedFrame>& frames, const Judge& judge) {
  std::vector<const DetectedFrame*> useful;
  for (const DetectedFrame& frame : frames) {
    if (NumTriangulable(frame, judge.options.min_score, 1, judge.min_views) > 0) useful.push_back(&frame);
  }
  const size_t count = std::min(useful.size(), static_cast<size_t>(judge.options.max_frames));
  Sample sample;
  for (size_t i = 0; i < count; ++i) {
    (i % 4 == 1 ? sample.choose : sample.judge).push_back(*useful[i * useful.size() / count]);
  }
  return sample;
}

/// Views that a point needs: two always agree somewhere along their epipolar lines, so three where the take has them.
int ViewsNeeded(const Take& take, double min_score) {
  int64_t by_two = 0, by_three = 0;
  for (const DetectedFrame& frame : take.frames()) {
    by_two += NumTriangulable(frame, min_score, 1, 2) > 0, by_three += NumTriangulable(frame, min_score, 1, 3) > 0;
  }
  return 2 * by_three >= by_two ? 3 : 2;
}

Judge JudgeOf(const Take& take, const CauseOptions& options, const RunContext& run) {
  Judge judge{options, SigmaPx(take.rig, options), ViewsNeeded(take, options.min_score), run.num_threads};
  return judge;
}

/// The best assumption of each cause on the frames that choose, as an index into the list.
std::map<Cause, size_t> BestOfEach(const std::vector<Assumption>& list, const Judge& judge, const RunContext& run) {
  ProgressStage stage(run, "look for the cause", static_cast<int64_t>(list.size()));
  std::map<Cause, size_t> best;
  std::vector<double> cost;
  for (const Assumption& assumption : list) {
    const FrameFit sum = Sum(FitFrames(assumption.rig, assumption.frames, judge));
    cost.push_back(sum.cost_px / std::max(sum.offered, 1));
    const auto [at, is_new] = best.emplace(assumption.cause, cost.size() - 1);
    if (!is_new && cost.back() < cost[at->second]) at->second = cost.size() - 1;
    stage.Advance();
  }
  return best;
}

/// Adds the trial; `given` are the frames without the assumption.
void Try(const Assumption& assumption, const std::vector<FrameFit>& given, const Judge& judge, CauseReport* report) {
  const std::vector<FrameFit> tried = FitFrames(assumption.rig, assumption.frames, judge);
  CauseTrial& trial = report->trials.emplace_back(CauseTrial{assumption.cause, assumption.text, assumption.remedy});
  SetFigures(tried, &trial);
  const bool same_frames = assumption.cause != Cause::kTimeOffset && assumption.cause != Cause::kRates;
  const bool much_less = trial.carried >= kMinCarried && trial.residual_px <= kMaxRatio * report->as_given.residual_px;
  const bool regained = trial.carried >= kNearlyAll && trial.carried - report->as_given.carried >= kRegained;
  trial.clear = (much_less || regained) && GainInErrors(given, tried, same_frames) >= kMinErrors;
}

/// Other clocks have other frames in common; the sample is drawn anew.
void TryClocks(const Take& take, const std::vector<FrameFit>& given, const Judge& judge, bool find_rates, const RunContext& run,
               CauseReport* report) {
  const std::vector<Clock> clocks = internal::ClocksAskedFor(take.rig, take.frames(), judge.options, find_rates, run);
  if (clocks.empty()) return;
  Assumption other = internal::WithClocks(take.rig, clocks);
  other.frames = Draw(ApplyClocks(take.frames(), clocks), judge).judge;
  if (other.frames.size() < 2) return;
  Try(other, given, judge, report);
  for (const Clock& clock : clocks)
    report->trials.back().offset_frames = std::max(report->trials.back().offset_frames, std::abs(clock.offset_frames));
}

/// Whether `a` is to be believed before `b`, which fits alike: people are no mirror images, and the cause is simpler.
bool IsSimpler(const CauseTrial& a, const CauseTrial& b) {
  return a.mirrors_people != b.mirrors_people ? b.mirrors_people : a.cause < b.cause;
}

/// Of clear trials as good as the best, to kAlike, the one of the simplest cause comes first.
void PreferSimpler(std::vector<CauseTrial>* trials) {
  if (trials->empty()) return;
  auto chosen = trials->begin();
  for (auto trial = trials->begin(); trial != trials->end(); ++trial) {
    const bool alike = trial->clear && trial->residual_px <= kAlike * trials->front().residual_px;
    if (alike && IsSimpler(*trial, *chosen)) chosen = trial;
  }
  if (chosen != trials->begin()) std::rotate(trials->begin(), chosen, chosen + 1);
}

std::string Message(const CauseTrial& given, const std::vector<CauseTrial>& trials) {
  const std::string figures =
      Format(", %.3g %% of the detections in a sample fit together, as given %.3g %%; mean residual %.2f px instead of %.2f px",
             100 * trials[0].carried, 100 * given.carried, trials[0].residual_px, given.residual_px);
  std::string message = trials[0].assumption + figures;
  for (size_t i = 1; i < trials.size(); ++i) {
    if (!trials[i].clear || trials[i].residual_px > kAlike * trials[0].residual_px || trials[i].mirrors_people) continue;
    message += "; much the same " + trials[i].assumption + Format(" (%.2f px)", trials[i].residual_px);
  }
  return message;
}

/// What every search for a cause starts with.
struct Setup {
  Take take;
  Judge judge;
  Sample sample;
  std::vector<FrameFit> given;
  CauseReport report;  ///< as given
};

CauseReport Nothing() {
  CauseReport report;
  report.as_given.assumption = "as given";
  return report;
}

std::optional<Setup> SetUp(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const CauseOptions& options,
                           const RunContext& run) {
  Setup setup;
  setup.report = Nothing();
  setup.take = WithCameras(rig, frames, BusiestCameras(rig, frames, options.max_cameras));
  if (setup.take.rig.cameras.size() < 2) return std::nullopt;
  setup.judge = JudgeOf(setup.take, options, run);
  setup.sample = Draw(setup.take.frames(), setup.judge);
  if (setup.sample.choose.empty()) return std::nullopt;
  setup.given = FitFrames(setup.take.rig, setup.sample.judge, setup.judge);
  SetFigures(setup.given, &setup.report.as_given);
  return setup;
}

/// A take without one of its cameras fits better than with all of them even when that camera is turned only, so what
/// explains every camera comes first.
void Rank(CauseReport* report) {
  const auto explains_all = [](const CauseTrial& trial) { return trial.cause != Cause::kMoved; };
  const bool any = std::any_of(report->trials.begin(), report->trials.end(),
                               [&](const CauseTrial& trial) { return trial.clear && explains_all(trial); });
  std::stable_sort(report->trials.begin(), report->trials.end(), [&](const CauseTrial& a, const CauseTrial& b) {
    if (any && explains_all(a) != explains_all(b)) return explains_all(a);
    return a.residual_px < b.residual_px;
  });
  PreferSimpler(&report->trials);
  if (!report->trials.empty() && report->trials[0].clear) report->message = Message(report->as_given, report->trials);
}

}  // namespace

std::string_view ToString(Cause cause) {
  constexpr std::string_view kNames[] = {"as-given",       "normalized", "y-from-below", "turned",   "poses-inverted",
                                         "poses-mirrored", "rates",      "time-offset",  "mirrored", "image-size",
                                         "distortion",     "term-order", "exchanged",    "moved"};
  return kNames[static_cast<int>(cause)];
}

int NumTriangulable(const DetectedFrame& frame, double min_score, int max_persons, int min_views) {
  int count = 0;
  for (const std::vector<int>& of_joint : internal::CountSeen(frame, min_score, max_persons))
    count += internal::PersonsOf(of_joint, min_views);
  return count;
}

CauseTrial FitAsGiven(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const CauseOptions& options,
                      const RunContext& run) {
  CauseTrial trial;
  trial.assumption = "as given";
  const Take take = WithCameras(rig, frames, BusiestCameras(rig, frames, options.max_cameras));
  if (take.rig.cameras.size() < 2) return trial;
  const Judge judge = JudgeOf(take, options, run);
  SetFigures(FitFrames(take.rig, Draw(take.frames(), judge).judge, judge), &trial);
  return trial;
}

CauseReport RankCauses(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                       const CauseOptions& options, const RunContext& run) {
  std::optional<Setup> setup = SetUp(rig, frames, options, run);
  if (!setup) return Nothing();
  setup->judge.sides = body.sides;
  CauseReport report = setup->report;
  const auto choosing = internal::Assumptions(setup->take.rig, setup->sample.choose, body.mirror, options.alike);
  const auto judging =
      internal::Assumptions(setup->take.rig, setup->sample.judge, body.mirror, options.alike);  // the same list, other frames
  for (const auto& [cause, i] : BestOfEach(choosing, setup->judge, run)) Try(judging[i], setup->given, setup->judge, &report);
  const bool find_rates = !options.alike || report.as_given.carried < kWellCarried;
  TryClocks(setup->take, setup->given, setup->judge, find_rates, run, &report);
  Rank(&report);
  return report;
}

CauseReport CheckTiming(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const CauseOptions& options,
                        const RunContext& run) {
  const std::optional<Setup> setup = SetUp(rig, frames, options, run);
  if (!setup) return Nothing();
  CauseReport report = setup->report;
  TryClocks(setup->take, setup->given, setup->judge, report.as_given.carried < kWellCarried, run, &report);
  Rank(&report);
  return report;
}

}  // namespace mvstudio::triangulate
