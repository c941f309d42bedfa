#include "calib/holdout.h"

#include <cmath>
#include <limits>

#include "calib/homography.h"
#include "calib/resection.h"

namespace mvstudio::calib {
namespace {

/// Appends the errors of one half of a held-out view, with the pose from the other half.
void ScoreHalf(const geometry::Camera& camera, const View& view, int pose_half, std::vector<double>* errors) {
  const Resection pose = ResectPlane(camera, HalfOf(view, pose_half));
  if (pose.status != Status::kOk) return;
  const View scored = HalfOf(view, 1 - pose_half);
  const auto residuals = ResidualsOf(scored, camera, pose.cam_from_board);
  if (!residuals) return;
  for (Eigen::Index i = 0; i < scored.size(); ++i) {
    if (scored.weights[i] > 0) errors->push_back(residuals->col(i).norm());
  }
}

std::vector<View> Spread(const std::vector<View>& views, int max_views) {
  std::vector<View> usable;
  for (const View& view : views) {
    if ((view.weights.array() > 0).count() >= 8) usable.push_back(view);
  }
  if (static_cast<int>(usable.size()) <= max_views) return usable;
  std::vector<View> spread;
  for (int i = 0; i < max_views; ++i) spread.push_back(usable[i * usable.size() / max_views]);
  return spread;
}

}  // namespace

Holdout HoldoutError(const MonoSolution& solution, geometry::LensModel model, int num_folds, int max_views) {
  Holdout result;
  const std::vector<View> views = Spread(solution.views, max_views);
  const int num_views = static_cast<int>(views.size());
  if (num_views < 3) {
    result.status = Status::kTooFewViews;
    result.rms_px = result.median_px = std::numeric_limits<double>::quiet_NaN();
    return result;
  }
  const int folds = std::min(num_folds, num_views);
  result.view_mean_square.assign(num_views, std::numeric_limits<double>::quiet_NaN());
  BundleOptions options;
  options.reject_outliers = false;
  for (int fold = 0; fold < folds; ++fold) {
    MonoSolution train = solution;
    train.views.clear();
    for (int v = 0; v < num_views; ++v) {
      if (v % folds != fold) train.views.push_back(views[v]);
    }
    train = RefineMono(train, model, options);
    if (train.status != Status::kOk && train.status != Status::kNotConverged) continue;
    for (int v = fold; v < num_views; v += folds) {
      std::vector<double> errors;
      for (int half = 0; half < 2; ++half) ScoreHalf(train.state.cameras[0], views[v], half, &errors);
      if (errors.empty()) continue;
      const Eigen::Map<const Eigen::ArrayXd> e(errors.data(), errors.size());
      result.view_mean_square[v] = e.square().mean();
      result.errors_px.insert(result.errors_px.end(), errors.begin(), errors.end());
    }
  }
  const Eigen::Map<const Eigen::VectorXd> all(result.errors_px.data(), result.errors_px.size());
  if (all.size() == 0) result.status = Status::kDegenerate;
  result.rms_px = all.size() ? std::sqrt(all.array().square().mean()) : std::numeric_limits<double>::quiet_NaN();
  result.median_px = all.size() ? Median(all) : std::numeric_limits<double>::quiet_NaN();
  return result;
}

}  // namespace mvstudio::calib
