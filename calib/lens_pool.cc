#include "calib/lens_pool.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/homography.h"
#include "calib/resection.h"
#include "core/median.h"

namespace mvstudio::calib {
namespace {

using geometry::Camera;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kMinCorners = 8;

Status SolvePool(const BundleOptions& options, LensPool* pool) {
  BundleOptions bundle = options;
  bundle.gauge = {Gauge::Kind::kNone, 0};
  bundle.refine_cameras = bundle.refine_boards = bundle.refine_time = false;
  bundle.refine_warp = pool->config.warp;
  bundle.refine_stretch = pool->config.stretch;
  bundle.fix_lens.clear(), bundle.fix_camera.clear();
  pool->bundle = SolveBundle(&pool->views, &pool->state, bundle);
  pool->status = pool->bundle.status;
  pool->message = pool->bundle.message;
  return pool->status;
}

/// Views of a camera that take part in the held-out error, evenly spread.
std::vector<int> Spread(const LensPool& pool, int camera_idx, int max_views) {
  std::vector<int> usable, spread;
  for (size_t v = 0; v < pool.views.size(); ++v) {
    if (pool.views[v].camera_idx == camera_idx && (pool.prior[v].array() > 0).count() >= kMinCorners)
      usable.push_back(static_cast<int>(v));
  }
  const size_t count = std::min(usable.size(), static_cast<size_t>(max_views));
  for (size_t i = 0; i < count; ++i) spread.push_back(usable[i * usable.size() / count]);
  return spread;
}

/// Pose from the corners with a weight, of which some may be wrong: those far off the first pose are left out.
Resection RobustResect(const Camera& camera, View view, const Eigen::Matrix3Xd& corners) {
  view.x_in_board = corners;
  const Eigen::VectorXd prior = view.weights;
  Resection pose = ResectPlane(camera, view);
  for (int round = 0; round < 3 && pose.status == Status::kOk; ++round) {
    const auto residuals = ResidualsOf(view, camera, pose.cam_from_board);
    if (!residuals) break;
    const Eigen::ArrayXd distances = residuals->colwise().norm().transpose().array() * prior.array().sqrt();
    const double limit = std::max(1e-6, 4 * Median(distances));
    view.weights = (distances <= limit).select(prior.array(), 0.0);
    if ((view.weights.array() > 0).count() < 4) break;
    const Resection next = RefinePose(camera, view, pose.cam_from_board);
    if (next.status != Status::kOk) break;
    pose = next;
  }
  return pose;
}

/// Appends the errors of one half of a held-out view, with the pose from the other half.
void ScoreHalf(const Camera& camera, const View& view, const RigState& state, int pose_half, std::vector<double>* errors) {
  const View from = HalfOf(view, pose_half), scored = HalfOf(view, 1 - pose_half);
  const Resection pose = RobustResect(camera, from, BentCorners(from, state));
  View any = scored;
  any.weights.setZero();
  const Eigen::Matrix3Xd corners = BentCorners(scored, state);
  const bool ok = pose.status == Status::kOk || pose.status == Status::kNotConverged;
  const Eigen::Matrix2Xd residuals = *ResidualsOf(any, camera, pose.cam_from_board, &corners);
  for (Eigen::Index i = 0; i < scored.size(); ++i) {
    if (scored.weights[i] > 0) errors->push_back(ok ? residuals.col(i).norm() : kInfinity);
  }
}

}  // namespace

std::string ToString(const LensConfig& config) {
  std::string text(geometry::ToString(config.model));
  if (config.model == geometry::LensModel::kSplined)
    text += " " + std::to_string(config.spline.cols) + "x" + std::to_string(config.spline.rows);
  return text + (config.shared ? ", shared" : "") + (config.warp ? ", bent board" : "") +
         (config.stretch ? ", stretched board" : "");
}

int NumLensParams(const LensConfig& config, int num_cameras) {
  const int one =
      config.model == geometry::LensModel::kSplined ? config.spline.NumControlParams() : geometry::NumParams(config.model);
  return config.shared ? one : one * num_cameras;
}

LensPool MakePool(const std::vector<MonoSolution>& monos, const std::vector<int>& cameras, int boards) {
  LensPool pool;
  pool.state.rig_from_board.assign(boards, geometry::Rigid3());
  pool.state.board_warp_m.assign(boards, Eigen::Vector2d::Zero());
  for (size_t c = 0; c < cameras.size(); ++c) {
    const MonoSolution& mono = monos[cameras[c]];
    pool.state.cameras.push_back(mono.state.cameras[0]);
    pool.state.cam_from_world.emplace_back();
    for (size_t v = 0; v < mono.views.size(); ++v) {
      View view = mono.views[v];
      pool.state.world_from_board.push_back(mono.state.world_from_board[view.frame]);
      view.camera_idx = static_cast<int>(c);
      view.frame = static_cast<int>(pool.views.size());
      pool.state.frames.push_back(view.frame);
      pool.prior.push_back(mono.prior[v]);
      pool.views.push_back(std::move(view));
    }
  }
  pool.config.model = pool.state.cameras[0].model;
  return pool;
}

LensPool FitPool(const LensPool& start, const LensConfig& config, const BundleOptions& options) {
  LensPool pool = start;
  pool.config = config;
  if (!config.stretch) pool.state.board_stretch.clear();
  Eigen::VectorXd mean;
  for (size_t c = 0; c < pool.state.cameras.size(); ++c) {
    Camera& camera = pool.state.cameras[c];
    camera = WithModel(camera, config.model, config.spline);
    mean = c == 0 ? camera.params : Eigen::VectorXd(mean + camera.params);
  }
  pool.state.lens_group.clear();
  if (config.shared) {
    pool.state.lens_group.assign(pool.state.cameras.size(), 0);
    for (Camera& camera : pool.state.cameras) camera.params = mean / static_cast<double>(pool.state.cameras.size());
  }
  if (options.reject_outliers) {
    for (size_t v = 0; v < pool.views.size(); ++v) {
      if ((pool.views[v].weights.array() > 0).any()) pool.views[v].weights = pool.prior[v];
    }
  }
  SolvePool(options, &pool);
  return pool;
}

PoolHoldout HoldoutErrors(const LensPool& fit, int num_folds, int max_views, const BundleOptions& options) {
  PoolHoldout result;
  result.view_errors_px.resize(fit.views.size());
  std::vector<int> fold_of(fit.views.size(), -1);
  int fewest = std::numeric_limits<int>::max();
  for (size_t c = 0; c < fit.state.cameras.size(); ++c) {
    const std::vector<int> spread = Spread(fit, static_cast<int>(c), max_views);
    fewest = std::min(fewest, static_cast<int>(spread.size()));
    for (size_t i = 0; i < spread.size(); ++i) fold_of[spread[i]] = static_cast<int>(i);
  }
  const int folds = std::min(num_folds, fewest);
  for (int& fold : fold_of) fold = fold < 0 ? -1 : fold % std::max(1, folds);
  if (fewest < 3) {
    result.status = Status::kTooFewViews;
    return result;
  }
  BundleOptions bundle = options;
  bundle.reject_outliers = false;
  bundle.cost_tolerance = 1e-6;
  bundle.first_damping = 1e-8;
  for (int fold = 0; fold < folds; ++fold) {
    LensPool train = fit;
    for (size_t v = 0; v < train.views.size(); ++v) {
      if (fold_of[v] == fold || fold_of[v] < 0) train.views[v].weights.setZero();
    }
    const Status status = SolvePool(bundle, &train);
    for (size_t v = 0; v < fit.views.size(); ++v) {
      if (fold_of[v] != fold) continue;
      View view = fit.views[v];
      view.weights = fit.prior[v];
      if (status != Status::kOk && status != Status::kNotConverged) {
        result.view_errors_px[v].assign((view.weights.array() > 0).count(), kInfinity);
        continue;
      }
      for (int half = 0; half < 2; ++half)
        ScoreHalf(train.state.cameras[view.camera_idx], view, train.state, half, &result.view_errors_px[v]);
    }
  }
  return result;
}

HoldoutSummary Summarize(const LensPool& pool, const PoolHoldout& holdout, int camera_idx) {
  std::vector<double> errors;
  for (size_t v = 0; v < pool.views.size() && v < holdout.view_errors_px.size(); ++v) {
    if (camera_idx >= 0 && pool.views[v].camera_idx != camera_idx) continue;
    errors.insert(errors.end(), holdout.view_errors_px[v].begin(), holdout.view_errors_px[v].end());
  }
  if (errors.empty()) return {kNan, kNan, kNan, 0};
  HoldoutSummary summary;
  double sum = 0;
  int good = 0;
  for (double e : errors) {
    if (e <= kGrossPx) sum += e * e, ++good;
  }
  summary.rms_px = good ? std::sqrt(sum / good) : kNan;
  summary.num_corners = static_cast<int>(errors.size());
  summary.gross_fraction = 1 - static_cast<double>(good) / static_cast<double>(errors.size());
  summary.median_px = UpperMedian(errors);
  return summary;
}

}  // namespace mvstudio::calib
