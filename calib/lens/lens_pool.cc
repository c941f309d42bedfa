#include "calib/lens/lens_pool.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/board/homography.h"
#include "calib/bundle/view_clusters.h"
#include "calib/lens/held_out_view.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::Camera;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kMinCorners = 4;

Status SolvePool(const BundleOptions& options, LensPool* pool) {
  pool->bundle = SolveBundle(&pool->views, &pool->state, PoolBundle(pool->config, options));
  pool->status = pool->bundle.status;
  pool->message = pool->bundle.message;
  return pool->status;
}

/// Views of a camera used for the held-out error, evenly spread over its clusters.
std::vector<int> Spread(const LensPool& pool, int camera_idx, int max_views) {
  std::vector<int> usable, spread;
  for (size_t v = 0; v < pool.views.size(); ++v) {
    if (pool.views[v].camera_idx == camera_idx && (pool.prior[v].array() > 0).count() >= kMinCorners)
      usable.push_back(static_cast<int>(v));
  }
  std::stable_sort(usable.begin(), usable.end(), [&](int a, int b) { return pool.cluster[a] < pool.cluster[b]; });
  const size_t count = std::min(usable.size(), static_cast<size_t>(max_views));
  for (size_t i = 0; i < count; ++i) spread.push_back(usable[i * usable.size() / count]);
  return spread;
}

constexpr int kNotScored = -1;
constexpr int kMinClusters = 3;  // of a camera whose boards are held out

/// Fold of every view that is scored; the views of a cluster are held out together, cameras with too few clusters are trained
/// on in every fold. Returns the number of folds, 0 when no camera has enough.
int AssignFolds(const LensPool& fit, int num_folds, int max_views, std::vector<int>* fold_of) {
  fold_of->assign(fit.views.size(), kNotScored);
  int fewest = std::numeric_limits<int>::max();
  for (size_t c = 0; c < fit.state.cameras.size(); ++c) {
    const std::vector<int> spread = Spread(fit, static_cast<int>(c), max_views);
    int rank = -1, last = -1;
    for (int v : spread) {
      rank += fit.cluster[v] != last;
      last = fit.cluster[v];
      (*fold_of)[v] = rank;
    }
    if (rank + 1 >= kMinClusters) fewest = std::min(fewest, rank + 1);
    for (int v : spread) {
      if (rank + 1 < kMinClusters) (*fold_of)[v] = kNotScored;
    }
  }
  if (fewest == std::numeric_limits<int>::max()) return 0;
  const int folds = std::min(num_folds, fewest);
  for (int& fold : *fold_of) fold = fold < 0 ? fold : fold % folds;
  return folds;
}

/// Fold in which a cluster of views is held out: with it those that are not scored.
std::vector<int> FoldsOfClusters(const LensPool& fit, const std::vector<int>& fold_of) {
  std::vector<int> folds(fit.views.size(), kNotScored);
  for (size_t v = 0; v < fit.views.size(); ++v) {
    if (fold_of[v] >= 0) folds[static_cast<size_t>(fit.cluster[v])] = fold_of[v];
  }
  return folds;
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

BundleOptions PoolBundle(const LensConfig& config, const BundleOptions& options) {
  BundleOptions bundle = options;
  bundle.gauge = {Gauge::Kind::kNone, 0};
  bundle.refine_cameras = bundle.refine_boards = bundle.refine_time = false;
  bundle.refine_warp = config.warp, bundle.refine_stretch = config.stretch;
  bundle.fix_lens.clear(), bundle.fix_camera.clear();
  return bundle;
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
  pool.cluster = ClusterViews(pool.views);
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
  std::vector<int> fold_of;
  const int folds = AssignFolds(fit, num_folds, max_views, &fold_of);
  if (folds == 0) {
    result.status = Status::kTooFewViews;
    return result;
  }
  const std::vector<int> fold_of_cluster = FoldsOfClusters(fit, fold_of);
  BundleOptions bundle = options;
  bundle.reject_outliers = false;
  bundle.cost_tolerance = 1e-6;
  bundle.first_damping = 1e-8;
  for (int fold = 0; fold < folds; ++fold) {
    LensPool train = fit;
    for (size_t v = 0; v < train.views.size(); ++v) {
      if (fold_of_cluster[static_cast<size_t>(fit.cluster[v])] == fold) train.views[v].weights.setZero();
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
      AppendHeldOutErrors(train.state.cameras[view.camera_idx], view, train.state, fit.state.world_from_board[v],
                          &result.view_errors_px[v]);
    }
  }
  return result;
}

std::vector<std::vector<double>> ErrorsOnOwnBoards(const LensPool& fit) {
  std::vector<std::vector<double>> errors_px(fit.views.size());
  for (size_t v = 0; v < fit.views.size(); ++v) {
    View view = fit.views[v];
    view.weights = fit.prior[v];
    if ((view.weights.array() > 0).count() < kMinCorners) continue;
    AppendHeldOutErrors(fit.state.cameras[static_cast<size_t>(view.camera_idx)], view, fit.state, fit.state.world_from_board[v],
                        &errors_px[v]);
  }
  return errors_px;
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
