#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "calib/calibrate_steps.h"
#include "calib/lens/resection.h"
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
int NumMovingFrames(const Work& work) {
  RigState state = work.state;
  EstimateMotion(work.views, &state);
  std::set<int> frames;
  for (const View& view : work.views) {
    if ((view.weights.array() > 0).any() && !state.board_velocity[view.frame].isZero()) frames.insert(view.frame);
  }
  return static_cast<int>(frames.size());
}

/// Squared errors per frame of one fold, with and without time offsets, lenses and cameras from the other folds.
void ScoreFold(const Work& work, int fold, int folds, double cap_px, std::vector<std::pair<double, double>>* scores) {
  std::vector<View> train, test;
  for (const View& view : work.views) (view.frame % folds == fold ? test : train).push_back(view);
  std::map<int, double> errors[2];
  RigState state = work.state;
  for (int with = 0; with < 2; ++with) {
    std::vector<View> views = train;
    BundleOptions options = work.bundle;
    options.reject_outliers = false;
    options.cost_tolerance = 1e-7;
    options.refine_time = with == 1;
    if (options.gauge.kind == Gauge::Kind::kBoard) options.gauge = {Gauge::Kind::kCamera, 0};
    for (int round = 0; round < (with ? kTimeRounds : 1); ++round) SolveBundle(&views, &state, options);
    errors[with] = FrameScores(test, state, cap_px);
  }
  for (const auto& [frame, score] : errors[0]) {
    const auto other = errors[1].find(frame);
    if (other != errors[1].end()) scores->emplace_back(score, other->second);
  }
}

/// The rule of lens models: offsets are simpler left out unless the gain is more than its standard error and worth a number.
bool JudgeTimeOffsets(const std::vector<std::pair<double, double>>& scores, std::string* reason) {
  std::vector<double> before, after;
  for (const auto& [without, with] : scores) before.push_back(without), after.push_back(with);
  const UnitMean gain = DifferenceOverUnits(before, after);
  const double usual = Mean(before);
  const bool pays = gain.mean > gain.standard_error && std::sqrt(1 - gain.mean / usual) < 1 - kNegligibleGain;
  *reason = Format("time offsets change the mean squared held-out error by %+.1f +- %.1f %%: %s", -100 * gain.mean / usual,
                   100 * gain.standard_error / usual, pays ? "estimated" : "left out");
  return pays;
}

}  // namespace

namespace {

/// The camera with the smallest sum of time differences to the others: the first of the synchronous ones where most are.
int MostInStep(const Work& work) {
  const std::vector<double>& late = work.state.time_offset_frames;
  std::set<int> seen;
  for (const View& view : work.views) {
    if ((view.weights.array() > 0).any()) seen.insert(view.camera_idx);
  }
  int best = work.bundle.time_reference;
  double least = std::numeric_limits<double>::infinity();
  for (const int reference : seen) {
    double sum = 0;
    for (const int c : seen) sum += std::abs(late[c] - late[reference]);
    if (sum < least * (1 - 1e-9)) least = sum, best = reference;
  }
  return best;
}

/// Changes the camera that defines the time of the frames.
void ChangeTimeReference(int reference, Work* work) {
  RigState& state = work->state;
  const double late = state.time_offset_frames[reference];
  for (size_t f = 0; f < state.world_from_board.size(); ++f)
    state.world_from_board[f] = geometry::Perturb(BoardStep(static_cast<int>(f), late, state), state.world_from_board[f]);
  for (double& offset : state.time_offset_frames) offset -= late;
  work->bundle.time_reference = reference;
}

}  // namespace

BundleReport SolveWithTimeOffsets(Work* work) {
  BundleReport report;
  work->bundle.refine_time = true;
  for (int round = 0; round < 1 + kTimeRounds; ++round) {
    if (round == 1) ChangeTimeReference(MostInStep(*work), work);
    for (size_t v = 0; v < work->views.size(); ++v) {
      if ((work->views[v].weights.array() > 0).any()) work->views[v].weights = work->prior[v];
    }
    report = SolveBundle(&work->views, &work->state, work->bundle);
    if (report.status != Status::kOk) break;
  }
  return report;
}

bool TimeOffsetsPay(const CalibrateOptions& options, const Work& work, double sigma_px, std::string* reason) {
  if (options.time_offset == LatenessChoice::kNone || options.intrinsics_only) return false;
  const bool mrcal = options.engine == Engine::kMrcal;
  *reason = mrcal ? "mrcal knows no time offsets" : "asked for";
  if (mrcal || options.time_offset == LatenessChoice::kOn) return !mrcal;
  if (NumMovingFrames(work) < kMinMovingFrames) {
    *reason = "too few frames follow upon each other to judge time offsets";
    return false;
  }
  Work quick = work;
  quick.bundle.reject_outliers = false;
  quick.bundle.refine_time = true;
  quick.bundle.cost_tolerance = 1e-5;
  const BundleReport all = SolveBundle(&quick.views, &quick.state, quick.bundle);
  *reason = "time offsets do not lower the residuals: left out";
  if (!(all.sigma_px < (1 - kNegligibleGain) * sigma_px)) return false;
  constexpr int kFolds = 4;
  const double cap_px = 6 * std::max(1e-6, UpperMedian(ErrorsOf(work.views, work.state)));
  std::vector<std::pair<double, double>> scores;
  for (int fold = 0; fold < kFolds; ++fold) ScoreFold(work, fold, kFolds, cap_px, &scores);
  if (scores.size() >= kMinMovingFrames) return JudgeTimeOffsets(scores, reason);
  *reason = "too few frames to judge time offsets";
  return false;
}

}  // namespace mvstudio::calib::internal
