#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>

#include "calib/calibrate_steps.h"
#include "calib/homography.h"
#include "calib/resection.h"

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

double MedianOf(const std::vector<double>& values) {
  return Median(Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size())));
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
    const double error = MedianOf(ErrorsOf(views, *state));
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
    const std::vector<double> errors = RigErrors(list, state);
    double sum = 0;
    for (double e : errors) sum += std::min(e * e, cap_px * cap_px);
    if (!errors.empty()) scores[frame] = sum / static_cast<double>(errors.size());
  }
  return scores;
}

}  // namespace

std::vector<double> RigErrors(const std::vector<View>& views, const RigState& state) {
  std::map<int, std::vector<View>> by_frame;
  for (const View& view : views) by_frame[view.frame].push_back(view);
  std::vector<double> errors;
  RigState local = state;
  for (const auto& [frame, list] : by_frame) {
    for (int half = 0; half < 2; ++half) {
      std::vector<View> from, scored;
      for (const View& view : list) from.push_back(HalfOf(view, half)), scored.push_back(HalfOf(view, 1 - half));
      if (!PlaceBoard(from, &local)) continue;
      const std::vector<double> more = ErrorsOf(scored, local);
      errors.insert(errors.end(), more.begin(), more.end());
    }
  }
  return errors;
}

bool TimeOffsetsPay(const Work& work, const BundleOptions& bundle, std::string* reason) {
  constexpr int kFolds = 4;
  const double cap_px = 6 * std::max(1e-6, MedianOf(ErrorsOf(work.views, work.state)));
  double sum = 0, squares = 0, before = 0;
  int n = 0;
  for (int fold = 0; fold < kFolds; ++fold) {
    std::vector<View> train, test;
    for (const View& view : work.views) (view.frame % kFolds == fold ? test : train).push_back(view);
    std::map<int, double> scores[2];
    for (int with = 0; with < 2; ++with) {
      RigState state = work.state;
      std::vector<View> views = train;
      BundleOptions options = bundle;
      options.reject_outliers = false;
      options.cost_tolerance = 1e-7;
      options.refine_time = with == 1;
      if (options.gauge.kind == Gauge::Kind::kBoard) options.gauge = {Gauge::Kind::kCamera, 0};
      for (int round = 0; round <= 2 * with; ++round) SolveBundle(&views, &state, options);
      scores[with] = FrameScores(test, state, cap_px);
    }
    for (const auto& [frame, score] : scores[0]) {
      const auto other = scores[1].find(frame);
      if (other == scores[1].end()) continue;
      const double difference = score - other->second;
      sum += difference, squares += difference * difference, before += score, ++n;
    }
  }
  if (n < 8) {
    *reason = "too few frames to judge time offsets";
    return false;
  }
  const double mean = sum / n, error = std::sqrt(std::max(0.0, squares / n - mean * mean) / (n - 1));
  const bool pays = mean > error;
  char text[200];
  std::snprintf(text, sizeof text, "time offsets change the mean squared held-out error by %+.1f +- %.1f %%: %s",
                -100 * sum / before, 100 * error * n / before, pays ? "estimated" : "left out");
  *reason = text;
  return pays;
}

}  // namespace mvstudio::calib::internal
