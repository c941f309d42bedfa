#include "triangulate/take/cause.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "core/choice/heldout_choice.h"
#include "core/format.h"
#include "core/parallel.h"
#include "triangulate/point/point.h"
#include "triangulate/sync/sync.h"
#include "triangulate/take/cause_trials.h"

namespace mvstudio::triangulate {
namespace {

using internal::Assumption;

constexpr double kLimitSigmas = 4;  // as TakeOptions::max_residual_sigmas
constexpr double kSigmaOfDiagonal = 0.005;
constexpr double kAlike = 1.03;
constexpr double kMaxRatio = 0.7, kMinErrors = 4, kMinCarried = 0.5;

/// Of one frame: detections that points could carry, those that points do, and the sum of min(residual, limit) over the former.
struct FrameFit {
  int offered = 0, carried = 0;
  double cost_px = 0;
};

bool IsSeen(const Keypoint& key, double min_score) { return key.score > 0 && key.score >= min_score && key.px.allFinite(); }

/// By joint, how many people of a camera's show it, largest number first. [joint][camera]
std::vector<std::vector<int>> CountSeen(const DetectedFrame& frame, double min_score, int max_persons) {
  std::vector<std::vector<int>> counts;
  for (size_t c = 0; c < frame.people.size(); ++c) {
    for (const DetectedPerson& person : frame.people[c]) {
      if (counts.size() < person.size()) counts.resize(person.size(), std::vector<int>(frame.people.size(), 0));
      for (size_t j = 0; j < person.size(); ++j) counts[j][c] += IsSeen(person[j], min_score);
    }
  }
  for (std::vector<int>& of_joint : counts) {
    for (int& count : of_joint) count = std::min(count, max_persons);
    std::sort(of_joint.rbegin(), of_joint.rend());
  }
  return counts;
}

/// Persons of which `min_views` cameras show this joint, at most.
int PersonsOf(const std::vector<int>& sorted_counts, int min_views) {
  return static_cast<int>(sorted_counts.size()) < min_views ? 0 : sorted_counts[static_cast<size_t>(min_views) - 1];
}

double SigmaPx(const geometry::Rig& rig, const CauseOptions& options) {
  if (options.sigma_px > 0) return options.sigma_px;
  double sum = 0;
  for (const auto& camera : rig.cameras) sum += std::hypot(camera.camera.width_px, camera.camera.height_px);
  return kSigmaOfDiagonal * sum / static_cast<double>(rig.cameras.size());
}

/// How takes are judged: the noise allowed, and how many views make a point.
struct Judge {
  CauseOptions options;
  double sigma_px = 1;
  int min_views = 3;
  int num_threads = 1;

  double limit_px() const { return kLimitSigmas * sigma_px; }
};

/// Who is who in one frame by this rig; in a frame with one person an image there is nothing to choose.
std::vector<std::vector<int>> Choices(const PreparedRig& rig, const DetectedFrame& frame, const Judge& judge) {
  const bool crowd =
      std::any_of(frame.people.begin(), frame.people.end(), [](const auto& people) { return people.size() > 1; });
  if (!crowd) {
    std::vector<int> choice;
    for (const auto& people : frame.people) choice.push_back(people.empty() ? -1 : 0);
    return {choice};
  }
  AssociationOptions options;
  options.min_score = judge.options.min_score;
  options.max_persons = judge.options.max_persons;
  options.sigma_px = judge.sigma_px;
  std::vector<std::vector<int>> choices;
  for (const Cluster& cluster : AssociateFrame(rig, frame, options)) {
    if (static_cast<int>(choices.size()) < judge.options.max_persons) choices.push_back(cluster.choice);
  }
  return choices;
}

void FitJoint(const PreparedRig& rig, const DetectedFrame& frame, const std::vector<int>& choice, size_t joint_idx,
              const Judge& judge, FrameFit* fit) {
  std::vector<Observation> seen;
  for (size_t c = 0; c < choice.size(); ++c) {
    if (choice[c] < 0) continue;
    const DetectedPerson& person = frame.people[c][static_cast<size_t>(choice[c])];
    if (joint_idx >= person.size() || !IsSeen(person[joint_idx], judge.options.min_score)) continue;
    seen.push_back({static_cast<int>(c), person[joint_idx].px, judge.sigma_px, 1});
  }
  PointOptions options;
  options.min_views = judge.min_views;
  options.max_hypotheses = 60;
  const Point point = TriangulatePoint(rig, seen, options);
  if (point.status != Status::kOk || static_cast<int>(point.used.size()) < judge.min_views) return;
  for (const int i : point.used) {
    const Observation& view = seen[static_cast<size_t>(i)];
    const PreparedCamera& camera = rig.cameras[static_cast<size_t>(view.camera_idx)];
    const auto at = camera.projector.Project(camera.ToCam(point.x_in_world - rig.origin_in_world));
    if (at.status != Status::kOk) continue;
    ++fit->carried;
    fit->cost_px += std::min((view.px - at.px).norm(), judge.limit_px());
  }
}

FrameFit FitFrame(const PreparedRig& rig, const DetectedFrame& frame, const Judge& judge) {
  FrameFit fit;
  const auto counts = CountSeen(frame, judge.options.min_score, judge.options.max_persons);
  for (const std::vector<int>& of_joint : counts) {
    const int persons = PersonsOf(of_joint, judge.min_views);
    for (const int count : of_joint) fit.offered += std::min(count, persons);
  }
  for (const std::vector<int>& choice : Choices(rig, frame, judge)) {
    for (size_t j = 0; j < counts.size(); ++j) FitJoint(rig, frame, choice, j, judge, &fit);
  }
  fit.carried = std::min(fit.carried, fit.offered);
  fit.cost_px += judge.limit_px() * (fit.offered - fit.carried);
  return fit;
}

std::vector<FrameFit> FitFrames(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const Judge& judge) {
  const PreparedRig prepared = Prepare(rig);
  std::vector<FrameFit> fits(frames.size());
  ParallelFor(static_cast<int64_t>(frames.size()), judge.num_threads,
              [&](int64_t f) { fits[static_cast<size_t>(f)] = FitFrame(prepared, frames[static_cast<size_t>(f)], judge); });
  return fits;
}

FrameFit Sum(const std::vector<FrameFit>& fits) {
  FrameFit sum;
  for (const FrameFit& fit : fits) {
    sum.offered += fit.offered, sum.carried += fit.carried, sum.cost_px += fit.cost_px;
  }
  return sum;
}

void SetFigures(const std::vector<FrameFit>& fits, CauseTrial* trial) {
  const FrameFit sum = Sum(fits);
  const double offered = std::max(sum.offered, 1);
  trial->num_detections = sum.offered;
  trial->carried = sum.carried / offered;
  trial->residual_px = sum.cost_px / offered;
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

/// A take of some of the cameras alone.
struct Take {
  geometry::Rig rig;
  std::vector<DetectedFrame> frames;
};

Take WithCameras(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const std::vector<size_t>& cameras) {
  Take take;
  for (const size_t c : cameras) take.rig.cameras.push_back(rig.cameras[c]);
  for (const DetectedFrame& frame : frames) {
    DetectedFrame& own = take.frames.emplace_back();
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
    if (NumCarriable(frame, judge.options.min_score, 1, judge.min_views) > 0) useful.push_back(&frame);
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
  for (const DetectedFrame& frame : take.frames) {
    by_two += NumCarriable(frame, min_score, 1, 2) > 0, by_three += NumCarriable(frame, min_score, 1, 3) > 0;
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
    cost.push_back(Sum(FitFrames(assumption.rig, assumption.frames, judge)).cost_px);
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
  const bool same_frames = assumption.cause != Cause::kTimeOffset;
  trial.clear = trial.carried >= kMinCarried && trial.residual_px <= kMaxRatio * report->as_given.residual_px &&
                GainInErrors(given, tried, same_frames) >= kMinErrors;
}

/// Other offsets have other frames in common; the sample is drawn anew.
void TryOffsets(const Take& take, const std::vector<FrameFit>& given, const Judge& judge, const RunContext& run,
                CauseReport* report) {
  const std::vector<double> offsets = internal::OffsetsAskedFor(take.rig, take.frames, judge.options, run);
  if (offsets.empty()) return;
  std::vector<DetectedFrame> frames = Draw(ApplyOffsets(take.frames, offsets), judge).judge;
  if (frames.size() < 2) return;
  Try({Cause::kTimeOffset, internal::OffsetText(take.rig, offsets),
       "run `mvstudio sync` and give its result with option 'sync'", take.rig, std::move(frames)},
      given, judge, report);
  for (const double offset : offsets)
    report->trials.back().offset_frames = std::max(report->trials.back().offset_frames, std::abs(offset));
}

/// Of clear trials as good as the best, to kAlike, the one of the simplest cause comes first.
void PreferSimpler(std::vector<CauseTrial>* trials) {
  if (trials->empty()) return;
  auto chosen = trials->begin();
  for (auto trial = trials->begin(); trial != trials->end(); ++trial) {
    const bool alike = trial->clear && trial->residual_px <= kAlike * trials->front().residual_px;
    if (alike && trial->cause < chosen->cause) chosen = trial;
  }
  if (chosen != trials->begin()) std::rotate(trials->begin(), chosen, chosen + 1);
}

std::string Message(const CauseTrial& given, const std::vector<CauseTrial>& trials) {
  const std::string figures =
      Format(", %.3g %% of the detections in a sample fit together, as given %.3g %%; mean residual %.2f px instead of %.2f px",
             100 * trials[0].carried, 100 * given.carried, trials[0].residual_px, given.residual_px);
  std::string message = trials[0].assumption + figures;
  for (size_t i = 1; i < trials.size(); ++i) {
    if (!trials[i].clear || trials[i].residual_px > kAlike * trials[0].residual_px) continue;
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
  setup.sample = Draw(setup.take.frames, setup.judge);
  if (setup.sample.choose.empty()) return std::nullopt;
  setup.given = FitFrames(setup.take.rig, setup.sample.judge, setup.judge);
  SetFigures(setup.given, &setup.report.as_given);
  return setup;
}

void Rank(CauseReport* report) {
  std::stable_sort(report->trials.begin(), report->trials.end(),
                   [](const CauseTrial& a, const CauseTrial& b) { return a.residual_px < b.residual_px; });
  PreferSimpler(&report->trials);
  if (!report->trials.empty() && report->trials[0].clear) report->message = Message(report->as_given, report->trials);
}

}  // namespace

std::string_view ToString(Cause cause) {
  constexpr std::string_view kNames[] = {"as-given",    "distortion", "term-order", "image-size",
                                         "time-offset", "exchanged",  "mirrored"};
  return kNames[static_cast<int>(cause)];
}

int NumCarriable(const DetectedFrame& frame, double min_score, int max_persons, int min_views) {
  int count = 0;
  for (const std::vector<int>& of_joint : CountSeen(frame, min_score, max_persons)) count += PersonsOf(of_joint, min_views);
  return count;
}

CauseTrial FitAsGiven(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const CauseOptions& options,
                      const RunContext& run) {
  CauseTrial trial;
  trial.assumption = "as given";
  const Take take = WithCameras(rig, frames, BusiestCameras(rig, frames, options.max_cameras));
  if (take.rig.cameras.size() < 2) return trial;
  const Judge judge = JudgeOf(take, options, run);
  SetFigures(FitFrames(take.rig, Draw(take.frames, judge).judge, judge), &trial);
  return trial;
}

CauseReport RankCauses(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                       const CauseOptions& options, const RunContext& run) {
  const std::optional<Setup> setup = SetUp(rig, frames, options, run);
  if (!setup) return Nothing();
  CauseReport report = setup->report;
  const auto choosing = internal::Assumptions(setup->take.rig, setup->sample.choose, body.mirror);
  const auto judging = internal::Assumptions(setup->take.rig, setup->sample.judge, body.mirror);  // the same list, other frames
  for (const auto& [cause, i] : BestOfEach(choosing, setup->judge, run)) Try(judging[i], setup->given, setup->judge, &report);
  TryOffsets(setup->take, setup->given, setup->judge, run, &report);
  Rank(&report);
  return report;
}

CauseReport CheckTiming(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const CauseOptions& options,
                        const RunContext& run) {
  const std::optional<Setup> setup = SetUp(rig, frames, options, run);
  if (!setup) return Nothing();
  CauseReport report = setup->report;
  TryOffsets(setup->take, setup->given, setup->judge, run, &report);
  Rank(&report);
  return report;
}

}  // namespace mvstudio::triangulate
