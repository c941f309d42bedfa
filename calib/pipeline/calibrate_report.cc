#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "calib/board/space_points.h"
#include "calib/bundle/board_shape.h"
#include "calib/lens/held_out_view.h"
#include "calib/lens/lens_pool.h"
#include "calib/lens/smooth_error.h"
#include "calib/pipeline/calibrate_steps.h"
#include "calib/rig/free_boards.h"
#include "core/statistics.h"

namespace mvstudio::calib::internal {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

bool Solved(const MonoSolution& mono) { return mono.status == Status::kOk || mono.status == Status::kNotConverged; }

double Coverage(const std::vector<View>& views, int camera_idx, const CameraInput& camera) {
  constexpr int kCols = 10, kRows = 8;
  std::set<int> cells;
  for (const View& view : views) {
    if (view.camera_idx != camera_idx) continue;
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      if (view.weights[i] <= 0) continue;
      const int col = static_cast<int>((view.px(0, i) + 0.5) * kCols / camera.width_px);
      const int row = static_cast<int>((view.px(1, i) + 0.5) * kRows / camera.height_px);
      cells.insert(std::clamp(row, 0, kRows - 1) * kCols + std::clamp(col, 0, kCols - 1));
    }
  }
  return static_cast<double>(cells.size()) / (kCols * kRows);
}

double OutsideFraction(const std::vector<View>& views, int camera_idx, const CameraInput& camera) {
  int outside = 0, all = 0;
  for (const View& view : views) {
    if (view.camera_idx != camera_idx) continue;
    for (Eigen::Index i = 0; i < view.size(); ++i, ++all) {
      const Eigen::Vector2d px = view.px.col(i);
      outside += px.minCoeff() < -0.5 || px.x() > camera.width_px - 0.5 || px.y() > camera.height_px - 0.5;
    }
  }
  return static_cast<double>(outside) / std::max(1, all);
}

bool CoversImage(const geometry::Projector& projector) {
  const geometry::Camera& camera = projector.camera();
  for (double u : {0.0, camera.width_px - 1.0}) {
    for (double v : {0.0, camera.height_px - 1.0}) {
      if (projector.Unproject({u, v}).status != Status::kOk) return false;
    }
  }
  return true;
}

/// Residuals and what is counted from them.
void ReportResiduals(const CalibrateInput& input, const Work& work, CalibrateReport* report) {
  const auto residuals = BundleResiduals(work.views, work.state);
  RigState prompt = work.state;
  prompt.time_offset_frames.clear();
  const bool late = !work.state.time_offset_frames.empty();
  const auto without = late ? BundleResiduals(work.views, prompt) : residuals;
  std::vector<double> sum(input.cameras.size(), 0);
  std::set<int64_t> frames;
  int num_rejected = input.num_corners_dropped;
  for (size_t v = 0; v < work.views.size(); ++v) {
    const View& view = work.views[v];
    CameraReport& camera = report->cameras[view.camera_idx];
    const bool used = (view.weights.array() > 0).any();
    camera.num_views += used;
    camera.num_lost_views += !used;
    if (used) frames.insert(work.state.frames[view.frame]);
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      const bool rejected = view.weights[i] <= 0;
      const Eigen::Vector2d r = residuals[v].col(i);
      report->residuals.push_back({view.camera_idx, work.state.frames[view.frame], view.corner_ids[i], view.px.col(i), r,
                                   rejected, view.board, r - without[v].col(i)});
      rejected ? ++camera.num_rejected : ++camera.num_corners;
      if (!rejected) sum[view.camera_idx] += r.squaredNorm();
    }
  }
  for (size_t c = 0; c < report->cameras.size(); ++c) {
    report->cameras[c].rms_px = std::sqrt(sum[c] / std::max(1, report->cameras[c].num_corners));
    num_rejected += report->cameras[c].num_rejected;
  }
  report->num_frames = static_cast<int>(frames.size());
  report->rejected_fraction = static_cast<double>(num_rejected) / std::max(1, num_rejected + report->num_corners);
}

void SetHoldout(std::vector<double> errors, CameraReport* camera) {
  double squares = 0, good = 0;
  for (const double e : errors) {
    if (e <= kGrossPx) squares += e * e, good += 1;
  }
  if (errors.empty()) return;
  camera->holdout_rms_px = good > 0 ? std::sqrt(squares / good) : kNan;
  camera->holdout_gross_fraction = 1 - good / static_cast<double>(errors.size());
  camera->holdout_median_px = UpperMedian(std::move(errors));
}

/// Boards that took no part in a held lens are all held out; with few of them, no other held-out figures are there.
void ReportHeldLens(const Work& work, int camera_idx, CameraReport* camera) {
  camera->smooth_rms_px = SmoothErrorPx(work.views, BundleResiduals(work.views, work.state), camera_idx);
  if (std::isfinite(camera->holdout_rms_px)) return;
  const geometry::Camera& lens = work.state.cameras[static_cast<size_t>(camera_idx)];
  std::vector<double> errors;
  for (const View& view : work.views) {
    if (view.camera_idx != camera_idx || !(view.weights.array() > 0).any()) continue;
    AppendHeldOutErrors(lens, view, work.state, CamFromBoard(view, work.state), &errors);
  }
  SetHoldout(std::move(errors), camera);
}

/// Few views, of points in space: each leaves some of its points out.
void ReportLeftOutPoints(const Work& work, int camera_idx, CameraReport* camera) {
  std::vector<double> errors;
  for (const View& view : work.views) {
    if (view.camera_idx != camera_idx || !SpansSpace(view.x_in_board, view.weights)) continue;
    AppendLeftOutPoints(work.state.cameras[static_cast<size_t>(camera_idx)], view, &errors);
    camera->points_in_space = true;
  }
  SetHoldout(std::move(errors), camera);
}

void ReportCameras(const CalibrateInput& input, const Work& work, CalibrateReport* report) {
  double squares = 0, gross = 0;
  std::vector<double> medians;
  int scored = 0;
  for (size_t c = 0; c < report->cameras.size(); ++c) {
    CameraReport& camera = report->cameras[c];
    const geometry::Camera& lens = work.state.cameras[c];
    const geometry::Projector projector(lens);
    camera.name = lens.name;
    camera.alone_rms_px = Solved(work.monos[c]) ? work.monos[c].bundle.rms_px : kNan;
    camera.model = lens.model;
    camera.num_params = static_cast<int>(lens.params.size());
    camera.focal_px = (lens.fx() + lens.fy()) / 2;
    camera.coverage = Coverage(work.views, static_cast<int>(c), input.cameras[c]);
    camera.outside_fraction = OutsideFraction(work.views, static_cast<int>(c), input.cameras[c]);
    camera.valid_radius = projector.valid_radius();
    camera.covers_image = CoversImage(projector);
    camera.folds = FindFolds(lens);
    camera.lens_held = work.bundle.fix_lens[c];
    if (camera.lens_held) ReportHeldLens(work, static_cast<int>(c), &camera);
    if (!camera.lens_held && !std::isfinite(camera.holdout_rms_px)) ReportLeftOutPoints(work, static_cast<int>(c), &camera);
    if (!std::isfinite(camera.holdout_rms_px)) continue;
    squares += camera.num_corners * camera.holdout_rms_px * camera.holdout_rms_px;
    gross += camera.num_corners * camera.holdout_gross_fraction;
    scored += camera.num_corners;
    medians.push_back(camera.holdout_median_px);
  }
  report->holdout_rms_px = scored ? std::sqrt(squares / scored) : kNan;
  report->holdout_gross_fraction = scored ? gross / scored : kNan;
  report->holdout_median_px = UpperMedian(medians);
}

void FillRig(const CalibrateInput& input, const Work& work, const geometry::RigGauge& gauge, CalibrateReport* report) {
  report->rig.gauge = gauge;
  for (size_t c = 0; c < work.state.cameras.size(); ++c) {
    report->rig.cameras.push_back({work.state.cameras[c], work.state.cam_from_world[c], std::nullopt, std::nullopt});
    if (!work.state.time_offset_frames.empty()) report->cameras[c].time_offset_frames = work.state.time_offset_frames[c];
    if (!work.state.time_rate.empty()) report->cameras[c].time_rate = work.state.time_rate[c];
  }
  report->frames = work.state.frames;
  report->world_from_board = work.state.world_from_board;
  report->rig_from_board = work.state.rig_from_board;
  report->free_boards = work.free_boards;
  if (work.free_boards) report->board_moves = FindBoardMoves(work.views, work.state);
  report->board_warp_m = work.state.board_warp_m;
  report->board_stretch = work.state.board_stretch;
  report->rig.boards = ShapesOf(input.boards, work.state);
}

void ReportHeldOut(const Work& work, CalibrateReport* report) {
  report->rig_holdout_rms_px = report->rig_holdout_median_px = report->rig_holdout_gross_fraction = kNan;
  for (CameraReport& camera : report->cameras) camera.rig_holdout_gross_fraction = kNan;
  if (work.held_out.empty()) return;
  const std::vector<RigError> errors = RigErrors(work.held_out, work.state);
  if (errors.empty()) return;
  std::vector<double> all, gross(report->cameras.size(), 0), count(report->cameras.size(), 0);
  double sum = 0, good = 0;
  for (const RigError& e : errors) {
    all.push_back(e.px);
    count[e.camera_idx] += 1;
    if (e.px <= kGrossPx) sum += e.px * e.px, good += 1;
    if (!(e.px <= kGrossPx)) gross[e.camera_idx] += 1;
  }
  for (size_t c = 0; c < count.size(); ++c)
    report->cameras[c].rig_holdout_gross_fraction = count[c] > 0 ? gross[c] / count[c] : kNan;
  report->rig_holdout_rms_px = good > 0 ? std::sqrt(sum / good) : kNan;
  report->rig_holdout_gross_fraction = 1 - good / static_cast<double>(errors.size());
  report->rig_holdout_median_px = UpperMedian(all);
}

/// " (only 3 boards in view of cam0)" where that may be why there is no solution.
std::string FewBoards(const CalibrateInput& input) {
  constexpr int kFew = 5;
  std::vector<int> boards(input.cameras.size(), 0);
  for (const Detection& d : input.detections) ++boards[static_cast<size_t>(d.camera_idx)];
  const size_t fewest = static_cast<size_t>(std::min_element(boards.begin(), boards.end()) - boards.begin());
  if (boards[fewest] >= kFew) return "";
  return " (only " + std::to_string(boards[fewest]) + (boards[fewest] == 1 ? " board" : " boards") + " in view of " +
         input.cameras[fewest].name + ")";
}

}  // namespace

void FillReport(const CalibrateInput& input, const Work& work, const geometry::RigGauge& gauge, CalibrateReport* report) {
  FillRig(input, work, gauge, report);
  const Eigen::Matrix3Xd corners = CornersInBoard(input.boards[0]);
  report->board_size_m = (corners.rowwise().maxCoeff() - corners.rowwise().minCoeff()).norm();
  ReportResiduals(input, work, report);
  ReportCameras(input, work, report);
  ReportHeldOut(work, report);
}

void AddLikelyCauses(const CalibrateInput& input, CalibrateReport* report) {
  const std::string& conflict = report->frames_conflict;
  if (!conflict.empty() && report->message.find(conflict) == std::string::npos)
    report->message = conflict + "; " + report->message;
  if (!report->held_conflict.empty()) report->message = report->held_conflict + "; " + report->message;
  if (!report->numbering.empty()) report->message = ToString(report->numbering[0]) + "; " + report->message;
  report->message += FewBoards(input);
}

}  // namespace mvstudio::calib::internal
