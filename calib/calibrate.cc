#include "calib/calibrate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "calib/homography.h"
#include "calib/intrinsics.h"
#include "calib/model_selection.h"
#include "calib/rig_init.h"
#include "calib/uncertainty.h"
#include "core/check.h"
#include "core/error.h"
#include "core/parallel.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;
using geometry::Rigid3;

constexpr double kMaxFocalSigma = 0.25;  // of the focal length; beyond it the focal length counts as undetermined
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// `--world`, parsed.
struct World {
  bool is_board = false;
  int camera = 0;
  int64_t frame_idx = 0;
};

World ParseWorld(const std::string& text, const std::vector<CameraInput>& cameras) {
  World world;
  const auto colon = text.find(':');
  const std::string kind = text.substr(0, colon), value = colon == std::string::npos ? "" : text.substr(colon + 1);
  if (kind == "camera") {
    if (value.empty()) return world;
    const auto found = std::find_if(cameras.begin(), cameras.end(), [&](const CameraInput& c) { return c.name == value; });
    if (found == cameras.end()) throw UsageError("--world " + text + ": there is no camera called '" + value + "'");
    world.camera = static_cast<int>(found - cameras.begin());
    return world;
  }
  if (kind != "board" || value.empty() || value.find_first_not_of("0123456789") != std::string::npos || value.size() > 9) {
    throw UsageError("--world " + text + ": expected camera, camera:NAME or board:FRAME");
  }
  world.is_board = true;
  world.frame_idx = std::stoll(value);
  return world;
}

/// World of a board that lies face up: x along its columns, z up, so y against its rows.
Rigid3 WorldFromFloorBoard() {
  Rigid3 world_from_board;
  world_from_board.rotation = Eigen::Quaterniond(0, 1, 0, 0);
  return world_from_board;
}

/// What the steps of the pipeline hand on.
struct Work {
  std::vector<View> views;
  std::vector<int64_t> frames;
  std::vector<MonoSolution> monos;         // per camera
  std::vector<std::vector<int>> view_ids;  // per camera: indices into views, in the order of its mono solution
  RigState state;
  Gauge gauge;
};

void Stop(Status status, const std::string& message, CalibrateReport* report) {
  report->status = status;
  report->message = message;
}

std::optional<LensModel> FixedModel(const CalibrateOptions& options) {
  if (options.model == "auto") return std::nullopt;
  const auto model = geometry::LensModelFromString(options.model);
  if (!model) throw UsageError("--model " + options.model + ": no such lens model; see --help");
  return model;
}

/// Each camera by itself.
bool CalibrateCameras(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run, Work* work,
                      CalibrateReport* report) {
  const LensModel model = FixedModel(options).value_or(LensModel::kBrown4);
  work->monos.resize(input.cameras.size());
  work->view_ids.resize(input.cameras.size());
  for (size_t v = 0; v < work->views.size(); ++v) work->view_ids[work->views[v].camera_idx].push_back(static_cast<int>(v));
  BundleOptions bundle = options.bundle;
  bundle.num_threads = 1;
  ParallelFor(static_cast<int64_t>(input.cameras.size()), run.num_threads, [&](int64_t c) {
    const CameraInput& camera = input.cameras[c];
    std::vector<View> views;
    for (int v : work->view_ids[c]) views.push_back(work->views[v]);
    const geometry::Camera start = geometry::MakePinhole(camera.name, camera.width_px, camera.height_px, camera.width_px);
    work->monos[c] = CalibrateMono(WithModel(start, model), views, work->frames, bundle);
  });
  for (const MonoSolution& mono : work->monos) {
    if (mono.status == Status::kOk || mono.status == Status::kNotConverged) continue;
    Stop(mono.status, mono.message, report);
    return false;
  }
  return true;
}

/// Lens model and held-out errors.
void ChooseLens(const CalibrateOptions& options, const RunContext& run, Work* work, CalibrateReport* report) {
  const int64_t num_cameras = static_cast<int64_t>(work->monos.size());
  std::vector<Holdout> holdouts(num_cameras);
  std::string reason = "given";
  if (!FixedModel(options)) {
    const ModelChoice choice =
        ChooseModel(work->monos, std::max(3, options.holdout_folds), options.holdout_views, run.num_threads);
    reason = choice.reason;
    if (choice.index >= 0) holdouts = choice.candidates[choice.index].holdouts;
    BundleOptions bundle = options.bundle;
    bundle.num_threads = 1;
    ParallelFor(num_cameras, run.num_threads, [&](int64_t c) {
      if (choice.model != work->monos[c].state.cameras[0].model)
        work->monos[c] = RefineMono(work->monos[c], choice.model, bundle);
    });
  }
  const bool missing = options.holdout_folds > 1 && holdouts[0].errors_px.empty();
  ParallelFor(missing ? num_cameras : 0, run.num_threads, [&](int64_t c) {
    holdouts[c] =
        HoldoutError(work->monos[c], work->monos[c].state.cameras[0].model, options.holdout_folds, options.holdout_views);
  });
  report->cameras.resize(num_cameras);
  for (int64_t c = 0; c < num_cameras; ++c) {
    const bool scored = !holdouts[c].errors_px.empty();
    report->cameras[c].model_reason = reason;
    report->cameras[c].holdout_rms_px = scored ? holdouts[c].rms_px : kNan;
    report->cameras[c].holdout_median_px = scored ? holdouts[c].median_px : kNan;
  }
}

/// Cameras in one frame, the gauge chosen.
bool PlaceCameras(const World& world, Work* work, CalibrateReport* report) {
  std::vector<Rigid3> cam_from_board(work->views.size());
  work->state.frames = work->frames;
  for (size_t c = 0; c < work->monos.size(); ++c) {
    const MonoSolution& mono = work->monos[c];
    work->state.cameras.push_back(mono.state.cameras[0]);
    for (size_t i = 0; i < work->view_ids[c].size(); ++i) {
      const int v = work->view_ids[c][i];
      cam_from_board[v] = mono.state.world_from_board[work->views[v].frame];
      if ((mono.views[i].weights.array() > 0).count() == 0) work->views[v].weights.setZero();
    }
  }
  const RigStart start = InitializeRig(work->views, cam_from_board, world.camera, &work->state);
  report->components = start.components;
  if (start.status == Status::kOk) return true;
  Stop(start.status, start.message, report);
  return false;
}

/// Moves the solution so that the board of the wanted frame defines the world.
bool UseBoardWorld(const World& world, Work* work, CalibrateReport* report) {
  const auto frame = std::lower_bound(work->frames.begin(), work->frames.end(), world.frame_idx);
  const int index = static_cast<int>(frame - work->frames.begin());
  const bool seen = frame != work->frames.end() && *frame == world.frame_idx &&
                    std::any_of(work->views.begin(), work->views.end(),
                                [&](const View& v) { return v.frame == index && (v.weights.array() > 0).any(); });
  if (!seen) {
    Stop(Status::kTooFewViews,
         "the board was not seen in frame " + std::to_string(world.frame_idx) + ", which is to define the world", report);
    return false;
  }
  const Rigid3 new_from_old = WorldFromFloorBoard() * geometry::Inverse(work->state.world_from_board[index]);
  for (Rigid3& world_from_board : work->state.world_from_board) world_from_board = new_from_old * world_from_board;
  for (Rigid3& cam_from_world : work->state.cam_from_world) cam_from_world = cam_from_world * geometry::Inverse(new_from_old);
  work->gauge = {Gauge::Kind::kBoard, index};
  return true;
}

bool Adjust(const CalibrateOptions& options, const RunContext& run, Work* work, CalibrateReport* report) {
  BundleOptions bundle = options.bundle;
  bundle.gauge = work->gauge;
  bundle.num_threads = ResolveThreads(run.num_threads);
  const BundleReport solved = SolveBundle(&work->views, &work->state, bundle);
  report->rms_px = solved.rms_px;
  report->sigma_px = solved.sigma_px;
  report->num_corners = solved.num_corners;
  if (solved.status == Status::kOk) return true;
  Stop(solved.status, solved.message, report);
  return solved.status == Status::kNotConverged;
}

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
  std::vector<double> sum(input.cameras.size(), 0);
  std::set<int> frames;
  int num_rejected = input.num_corners_dropped;
  for (size_t v = 0; v < work.views.size(); ++v) {
    const View& view = work.views[v];
    CameraReport& camera = report->cameras[view.camera_idx];
    const bool used = (view.weights.array() > 0).any();
    camera.num_views += used;
    if (used) frames.insert(view.frame);
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      const bool rejected = view.weights[i] <= 0;
      const Eigen::Vector2d r = residuals[v].col(i);
      report->residuals.push_back({view.camera_idx, work.frames[view.frame], view.corner_ids[i], view.px.col(i), r, rejected});
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

void ReportCameras(const CalibrateInput& input, const Work& work, CalibrateReport* report) {
  double squares = 0;
  std::vector<double> medians;
  int scored = 0;
  for (size_t c = 0; c < report->cameras.size(); ++c) {
    CameraReport& camera = report->cameras[c];
    const geometry::Camera& lens = work.state.cameras[c];
    const geometry::Projector projector(lens);
    camera.name = lens.name;
    camera.model = lens.model;
    camera.num_params = static_cast<int>(lens.params.size());
    camera.focal_px = (lens.fx() + lens.fy()) / 2;
    camera.coverage = Coverage(work.views, static_cast<int>(c), input.cameras[c]);
    camera.valid_radius = projector.valid_radius();
    camera.covers_image = CoversImage(projector);
    if (!std::isfinite(camera.holdout_rms_px)) continue;
    squares += camera.num_corners * camera.holdout_rms_px * camera.holdout_rms_px;
    scored += camera.num_corners;
    medians.push_back(camera.holdout_median_px);
  }
  report->holdout_rms_px = scored ? std::sqrt(squares / scored) : kNan;
  report->holdout_median_px =
      medians.empty() ? kNan : Median(Eigen::Map<const Eigen::VectorXd>(medians.data(), medians.size()));
}

void FillRig(const Work& work, const std::string& gauge, CalibrateReport* report) {
  report->gauge = report->rig.gauge = gauge;
  for (size_t c = 0; c < work.state.cameras.size(); ++c) {
    report->rig.cameras.push_back({work.state.cameras[c], work.state.cam_from_world[c], std::nullopt, std::nullopt});
  }
  report->frames = work.frames;
  report->world_from_board = work.state.world_from_board;
}

void AddCovariance(const Work& work, CalibrateReport* report) {
  const RigCovariance covariance = ComputeCovariance(work.views, work.state, work.gauge, report->sigma_px);
  if (covariance.status != Status::kOk) return Stop(covariance.status, covariance.message, report);
  for (size_t c = 0; c < work.state.cameras.size(); ++c) {
    report->rig.cameras[c].params_covariance = covariance.params[c];
    report->rig.cameras[c].cam_from_world_covariance = covariance.cam_from_world[c];
    CameraReport& camera = report->cameras[c];
    camera.focal_sigma_px = std::sqrt((covariance.params[c](0, 0) + covariance.params[c](1, 1)) / 2);
    if (camera.focal_sigma_px > kMaxFocalSigma * camera.focal_px) {
      Stop(Status::kDegenerate,
           "camera " + camera.name + ": the boards do not determine its focal length: show the board tilted", report);
    }
  }
}

void CheckInput(const CalibrateInput& input) {
  MVS_CHECK(!input.cameras.empty(), "no cameras");
  std::set<std::string> names;
  for (const CameraInput& camera : input.cameras) {
    MVS_CHECK(camera.width_px > 0 && camera.height_px > 0,
              "camera " << camera.name << " is " << camera.width_px << "x" << camera.height_px);
    if (!names.insert(camera.name).second) throw UsageError("camera '" + camera.name + "' is given twice");
  }
  std::set<std::pair<int, int64_t>> seen;
  for (const Detection& d : input.detections) {
    MVS_CHECK(d.camera_idx >= 0 && d.camera_idx < static_cast<int>(input.cameras.size()),
              "detection of camera " << d.camera_idx);
    MVS_CHECK(seen.insert({d.camera_idx, d.frame_idx}).second,
              "camera " << d.camera_idx << " has frame " << d.frame_idx << " twice");
  }
}

void RunPipeline(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run, CalibrateReport* report) {
  const World world = ParseWorld(options.world, input.cameras);
  Work work;
  work.views = MakeViews(input.board, input.detections, &work.frames);
  ProgressStage stage(run, "calibrating", 5);
  if (!CalibrateCameras(input, options, run, &work, report)) return;
  stage.Advance(1, "cameras");
  ChooseLens(options, run, &work, report);
  stage.Advance(1, "lens model");
  if (!PlaceCameras(world, &work, report)) return;
  work.gauge = {Gauge::Kind::kCamera, world.camera};
  if (world.is_board && !UseBoardWorld(world, &work, report)) return;
  stage.Advance(1, "rig");
  if (!Adjust(options, run, &work, report)) return;
  stage.Advance(1, "adjustment");
  if (world.is_board) {
    FillRig(work, "board in frame " + std::to_string(world.frame_idx), report);
  } else {
    FillRig(work, "camera " + input.cameras[world.camera].name, report);
  }
  ReportResiduals(input, work, report);
  ReportCameras(input, work, report);
  AddCovariance(work, report);
  stage.Advance(1, "covariance");
}

}  // namespace

CalibrateReport Calibrate(const CalibrateInput& input, const CalibrateOptions& options, const RunContext& run) {
  CheckInput(input);
  CalibrateReport report;
  RunPipeline(input, options, run, &report);
  report.verdict = Judge(report);
  return report;
}

}  // namespace mvstudio::calib
