#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "calib/lens/resection.h"
#include "calib/pipeline/calibrate_steps.h"
#include "core/choice/heldout_choice.h"
#include "core/format.h"
#include "core/statistics.h"

namespace mvstudio::calib::internal {
namespace {

using geometry::Rigid3;

/// Errors (all corners, px) of the views at `state`; infinite where a corner does not project.
std::vector<double> ErrorsOf(const std::vector<View>& views, const RigState& state) {
  std::vector<double> errors;
  for (const Eigen::Matrix2Xd& residuals : BundleResiduals(views, state)) {
    for (Eigen::Index i = 0; i < residuals.cols(); ++i) errors.push_back(residuals.col(i).norm());
  }
  return errors;
}

/// Pose of the first board in the frame of `views`, lenses and cameras as they are.
bool PlaceBoard(std::vector<View> views, RigState* state) {
  const int frame = views[0].frame;
  double best = std::numeric_limits<double>::infinity();
  Rigid3 best_pose;
  for (const View& view : views) {
    View bent = view;
    bent.x_in_board = BentCorners(view, *state);
    const Resection pose = ResectPlane(state->cameras[view.camera_idx], bent);
    if (pose.status != Status::kOk && pose.status != Status::kNotConverged) continue;
    state->world_from_board[frame] = geometry::Inverse(state->cam_from_world[view.camera_idx]) * pose.cam_from_board *
                                     geometry::Inverse(state->rig_from_board[view.board]);
    const double error = UpperMedian(ErrorsOf(views, *state));
    if (error < best) best = error, best_pose = state->world_from_board[frame];
  }
  if (!std::isfinite(best)) return false;
  state->world_from_board[frame] = best_pose;
  BundleOptions options;
  options.gauge = {Gauge::Kind::kNone, 0};
  options.refine_intrinsics = options.refine_cameras = options.refine_boards = false;
  const BundleReport report = SolveBundle(&views, state, options);
  return report.status == Status::kOk || report.status == Status::kNotConverged;
}

/// Mean capped squares of the errors per frame.
std::map<int, double> FrameScores(const std::vector<View>& views, const RigState& state, double cap_px) {
  std::map<int, double> scores;
  std::map<int, std::vector<View>> by_frame;
  for (const View& view : views) by_frame[view.frame].push_back(view);
  for (const auto& [frame, list] : by_frame) {
    const std::vector<RigError> errors = RigErrors(list, state);
    double sum = 0;
    for (const RigError& e : errors) sum += std::min(e.px * e.px, cap_px * cap_px);
    if (!errors.empty()) scores[frame] = sum / static_cast<double>(errors.size());
  }
  return scores;
}

}  // namespace

std::vector<RigError> RigErrors(const std::vector<View>& views, const RigState& state) {
  std::map<int, std::vector<View>> by_frame;
  for (const View& view : views) by_frame[view.frame].push_back(view);
  std::vector<RigError> errors;
  RigState local = state;
  for (const auto& [frame, list] : by_frame) {
    for (int half = 0; half < 2; ++half) {
      std::vector<View> from, scored;
      for (const View& view : list) from.push_back(HalfOf(view, half)), scored.push_back(HalfOf(view, 1 - half));
      const bool placed = PlaceBoard(from, &local);
      const std::vector<Eigen::Matrix2Xd> residuals = BundleResiduals(scored, local);
      for (size_t v = 0; v < scored.size(); ++v) {
        for (Eigen::Index i = 0; i < scored[v].size(); ++i)
          errors.push_back(
              {scored[v].camera_idx, placed ? residuals[v].col(i).norm() : std::numeric_limits<double>::infinity()});
      }
    }
  }
  return errors;
}

namespace {

constexpr int kTimeRounds = 3;  // the boards' motion follows from their poses
constexpr int kMinMovingFrames = 8;

/// Frames whose boards' motion is known from their neighbours.
int NumMovingFrames(const Work& work, const MotionModel& motion) {
  RigState state = work.state;
  state.motion = motion;
  EstimateMotion(work.views, &state);
  std::set<int> frames;
  for (const View& view : work.views) {
    if ((view.weights.array() > 0).any() && !state.board_velocity[view.frame].isZero()) frames.insert(view.frame);
  }
  return static_cast<int>(frames.size());
}

/// Neighbours as far away as frames of such a recording are, every eighth, say; or `times` that.
MotionModel WideMotion(const Work& work, int64_t times) {
  std::vector<int64_t> seen, gaps;
  for (const View& view : work.views) {
    if ((view.weights.array() > 0).any()) seen.push_back(work.state.frames[static_cast<size_t>(view.frame)]);
  }
  std::sort(seen.begin(), seen.end());
  for (size_t i = 1; i < seen.size(); ++i) {
    if (seen[i] > seen[i - 1]) gaps.push_back(seen[i] - seen[i - 1]);
  }
  const int64_t gap = times * UpperMedian(std::move(gaps), int64_t{1});
  return {3 * gap, 2, gap};
}

/// Corners as they were before the rig was adjusted, less what already contradicts its own camera.
void RestoreWeights(Work* work) {
  for (size_t v = 0; v < work->views.size(); ++v) {
    if (work->placed[v]) work->views[v].weights = work->prior[v];
  }
  for (size_t c = 0; c < work->monos.size(); ++c) {
    const std::vector<View>& alone = work->monos[c].views;
    for (size_t i = 0; i < alone.size() && i < work->view_ids[c].size(); ++i) {
      Eigen::VectorXd& weights = work->views[static_cast<size_t>(work->view_ids[c][i])].weights;
      if (alone[i].weights.size() == weights.size()) weights = (alone[i].weights.array() > 0).select(weights, 0);
    }
  }
}

BundleOptions QuickOptions(const Work& work, const TimeModel& time) {
  BundleOptions options = work.bundle;
  options.reject_outliers = false;
  options.refine_time = time.offsets;
  options.refine_rate = time.rates;
  if (options.gauge.kind == Gauge::Kind::kBoard) options.gauge = {Gauge::Kind::kCamera, 0};
  return options;
}

/// Standard deviation of the corners, weights as they are, after a short adjustment.
double QuickSigma(Work work, const TimeModel& time, int rounds = kTimeRounds) {
  BundleOptions options = QuickOptions(work, time);
  options.cost_tolerance = 1e-5;
  work.state.motion = time.motion;
  BundleReport report;
  for (int round = 0; round < (time.offsets ? rounds : 1); ++round) report = SolveBundle(&work.views, &work.state, options);
  const bool usable = report.status == Status::kOk || report.status == Status::kNotConverged;
  return usable ? report.sigma_px : std::numeric_limits<double>::infinity();
}

bool Lower(double sigma, double than) { return sigma < (1 - kNegligibleGain) * than; }

/// Mean squared errors of held-out frames, one column a model of time.
using FrameErrors = std::vector<std::vector<double>>;

/// Adds those of one fold, lenses and cameras from the other folds.
void ScoreFold(const Work& work, const std::vector<TimeModel>& models, int fold, int folds, double cap_px,
               FrameErrors* scores) {
  std::vector<View> train, test;
  for (const View& view : work.views) (view.frame % folds == fold ? test : train).push_back(view);
  std::vector<std::map<int, double>> errors;
  RigState state = work.state;
  for (const TimeModel& time : models) {
    std::vector<View> views = train;
    BundleOptions options = QuickOptions(work, time);
    options.cost_tolerance = 1e-7;
    state.motion = time.motion;
    for (int round = 0; round < (time.offsets ? kTimeRounds : 1); ++round) SolveBundle(&views, &state, options);
    errors.push_back(FrameScores(test, state, cap_px));
  }
  for (const auto& [frame, score] : errors[0]) {
    std::vector<double> row;
    for (const auto& of_model : errors) {
      if (const auto found = of_model.find(frame); found != of_model.end()) row.push_back(found->second);
    }
    if (row.size() != models.size()) continue;
    for (size_t m = 0; m < row.size(); ++m) (*scores)[m].push_back(row[m]);
  }
}

FrameErrors HeldOutErrors(const Work& work, const std::vector<TimeModel>& models) {
  constexpr int kFolds = 4;
  const double cap_px = 6 * std::max(1e-6, UpperMedian(ErrorsOf(work.views, work.state)));
  FrameErrors scores(models.size());
  for (int fold = 0; fold < kFolds; ++fold) ScoreFold(work, models, fold, kFolds, cap_px, &scores);
  return scores;
}

/// The rule of lens models: offsets are simpler left out unless the gain is more than its standard error and worth a number.
bool JudgeTime(const char* what, const std::vector<double>& before, const std::vector<double>& after, double standard_errors,
               std::string* reason) {
  const UnitMean gain = DifferenceOverUnits(before, after);
  const double usual = Mean(before);
  const bool pays = gain.mean > standard_errors * gain.standard_error && std::sqrt(1 - gain.mean / usual) < 1 - kNegligibleGain;
  *reason += Format("%s change the mean squared held-out error by %+.1f +- %.1f %%: %s", what, -100 * gain.mean / usual,
                    100 * gain.standard_error / usual, pays ? "estimated" : "left out");
  return pays;
}

/// The simplest model of time among offsets and rates that held-out frames call for. A motion told from frames far apart must
/// prove itself more clearly: boards that stood still in between have none.
TimeModel JudgeModels(const Work& work, const TimeModel& with, std::string* reason) {
  constexpr double kRateErrors = 3, kWideErrors = 3;
  TimeModel offsets = with, none;
  offsets.rates = false;
  const bool wide = with.motion.reach > MotionModel().reach;
  std::vector<TimeModel> models = {none, offsets};
  if (with.rates) models.push_back(with);
  const FrameErrors errors = HeldOutErrors(work, models);
  if (errors[0].size() < kMinMovingFrames) {
    *reason = "too few frames to judge time offsets";
    return none;
  }
  reason->clear();
  const bool pay = JudgeTime("time offsets", errors[0], errors[1], wide ? kWideErrors : 1, reason);
  if (!with.rates) return pay ? offsets : none;
  *reason += "; ";
  const bool rates_pay = JudgeTime("rates of the clocks", pay ? errors[1] : errors[0], errors[2], kRateErrors, reason);
  return rates_pay ? with : pay ? offsets : none;
}

/// The camera with the smallest sum of time differences to the others: the first of the synchronous ones where most are.
int MostInStep(const Work& work) {
  const RigState& state = work.state;
  std::set<int> seen;
  for (const View& view : work.views) {
    if ((view.weights.array() > 0).any()) seen.insert(view.camera_idx);
  }
  const auto apart = [&](int a, int b) {
    double sum = 0;
    for (const int frame : {0, static_cast<int>(state.frames.size()) - 1})
      sum += std::abs(LateFrames(a, frame, state) - LateFrames(b, frame, state));
    return sum;
  };
  int best = work.bundle.time_reference;
  double least = std::numeric_limits<double>::infinity();
  for (const int reference : seen) {
    double sum = 0;
    for (const int c : seen) sum += apart(c, reference);
    if (sum < least * (1 - 1e-9)) least = sum, best = reference;
  }
  return best;
}

/// Changes the camera that defines the time of the frames.
void ChangeTimeReference(int reference, Work* work) {
  RigState& state = work->state;
  for (size_t f = 0; f < state.world_from_board.size(); ++f) {
    const double late = LateFrames(reference, static_cast<int>(f), state);
    state.world_from_board[f] = geometry::Perturb(BoardStep(static_cast<int>(f), late, state), state.world_from_board[f]);
  }
  const double late = state.time_offset_frames[static_cast<size_t>(reference)];
  for (double& offset : state.time_offset_frames) offset -= late;
  const double rate = state.time_rate.empty() ? 0 : state.time_rate[static_cast<size_t>(reference)];
  for (double& other : state.time_rate) other -= rate;
  work->bundle.time_reference = reference;
}

}  // namespace

BundleReport SolveWithTimeOffsets(const TimeModel& time, Work* work) {
  BundleReport report;
  work->bundle.refine_time = true;
  work->bundle.refine_rate = time.rates;
  work->state.motion = time.motion;
  for (int round = 0; round < 1 + kTimeRounds; ++round) {
    if (round == 1) ChangeTimeReference(MostInStep(*work), work);
    for (size_t v = 0; v < work->views.size(); ++v) {
      if (work->placed[v]) work->views[v].weights = work->prior[v];
    }
    report = SolveBundle(&work->views, &work->state, work->bundle);
    if (report.status != Status::kOk) break;
  }
  return report;
}

TimeModel ChooseTimeModel(const CalibrateOptions& options, const Work& work, double sigma_px, std::string* reason) {
  TimeModel none, with;
  if (options.time_offset == TimeOffsetChoice::kNone || options.intrinsics_only) return none;
  const bool mrcal = options.engine == Engine::kMrcal;
  *reason = mrcal ? "mrcal knows no time offsets" : "asked for";
  with.offsets = true, with.rates = options.time_offset == TimeOffsetChoice::kClocks;
  const bool wide = NumMovingFrames(work, with.motion) < kMinMovingFrames;
  if (wide) with.motion = WideMotion(work, 1);
  if (mrcal || options.time_offset != TimeOffsetChoice::kAuto) return mrcal ? none : with;
  if (NumMovingFrames(work, with.motion) < kMinMovingFrames) {
    *reason = "too few frames follow upon each other to judge time offsets";
    return none;
  }
  with.rates = true;
  *reason = "time offsets do not lower the residuals: left out";
  if (!Lower(QuickSigma(work, with, 1), sigma_px)) return none;
  Work fresh = work;
  RestoreWeights(&fresh);
  TimeModel offsets = with;
  offsets.rates = false;
  double least = QuickSigma(fresh, with);
  with.rates = Lower(least, QuickSigma(fresh, offsets));
  for (const int64_t times : {1, 4}) {  // late by more than a frame, a camera needs more than the nearest neighbours
    if (!with.rates) break;
    TimeModel wider = with;
    wider.motion = WideMotion(work, times);
    const double sigma = QuickSigma(fresh, wider);
    if (Lower(sigma, least)) least = sigma, with = wider;
  }
  return JudgeModels(fresh, with, reason);
}

}  // namespace mvstudio::calib::internal
