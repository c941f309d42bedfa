#include "calib/check/lens_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/check/check_steps.h"
#include "calib/check/rig_compare.h"
#include "calib/lens/intrinsics.h"

namespace mvstudio::calib {
namespace {

struct Fit {
  MonoSolution solution;
  double squares = 0;  // px^2
  int num_corners = 0;
};

/// The boards' poses, and with `free` the lens, at corners that stay those that they are.
Fit RefitLens(const geometry::Camera& camera, const std::vector<View>& views, bool free) {
  BundleOptions options;
  options.refine_intrinsics = free;
  options.reject_outliers = false;
  Fit fit{RefineMono(camera, views, options)};
  if (fit.solution.status != Status::kOk) return fit;
  const std::vector<Eigen::Matrix2Xd> residuals = BundleResiduals(fit.solution.views, fit.solution.state);
  for (size_t v = 0; v < residuals.size(); ++v) {
    for (Eigen::Index i = 0; i < residuals[v].cols(); ++i) {
      if (fit.solution.views[v].weights[i] <= 0) continue;
      fit.squares += residuals[v].col(i).squaredNorm();
      ++fit.num_corners;
    }
  }
  return fit;
}

double MeanFocal(const geometry::Camera& camera) { return 0.5 * (camera.fx() + camera.fy()); }

}  // namespace

LensCheck CheckLens(const geometry::Camera& camera, std::vector<View> views, double sigmas, double least_px) {
  constexpr double kVisible = 0.02, kOfHalfDiagonal = 0.7;
  LensCheck check;
  check.num_views = static_cast<int>(views.size());
  check.status = check.num_views < LensCheck::kFewestViews ? Status::kTooFewViews : Status::kOk;
  for (View& view : views) view.weights = (view.weights.array() > 0).cast<double>();
  const Fit stated = RefitLens(camera, views, false);
  if (check.status == Status::kOk) check.status = stated.solution.status;
  check.num_corners = stated.num_corners;
  check.rms_px = std::sqrt(stated.squares / std::max(stated.num_corners, 1));
  check.focal_px = MeanFocal(camera);
  if (check.status != Status::kOk) return check;
  const Fit free = RefitLens(camera, views, true);
  check.status = free.solution.status;
  if (check.status != Status::kOk) return check;
  const geometry::Camera& refitted = free.solution.state.cameras[0];
  const double num_params = static_cast<double>(refitted.params.size());
  const double freedom = 2.0 * free.num_corners - 6.0 * check.num_views - num_params;
  if (freedom <= 0) {
    check.status = Status::kTooFewViews;
    return check;
  }
  check.refitted_rms_px = std::sqrt(free.squares / free.num_corners);
  check.refitted_focal_px = MeanFocal(refitted);
  const double gain = std::max(0.0, stated.squares - free.squares);
  check.significance = std::sqrt(gain / (free.squares / freedom) / num_params);
  ProjectionDiffOptions far;
  far.ranges_m = {std::numeric_limits<double>::infinity()};
  far.focus = kOfHalfDiagonal;
  const ProjectionDiff difference = CompareProjection(refitted, camera, far);
  if (difference.status == Status::kOk) check.shift_px = difference.ranges[0].rms_px;
  check.changed = check.significance > sigmas && gain > kVisible * free.squares && check.shift_px > least_px;
  return check;
}

namespace internal {

void CheckLensesAlone(CheckWork* work) {
  for (size_t c = 0; c < work->checks.size(); ++c) {
    if (!work->present[c] || !work->boards_of[c].empty() || work->views_alone[c].empty()) continue;
    const RigCheckOptions& options = work->options;
    work->checks[c].lens = CheckLens(work->problem.cameras[c], work->views_alone[c], options.bump_sigmas, options.bump_px);
    work->checks[c].num_corners = work->checks[c].lens->num_corners;
  }
}

bool IsOneLens(const CheckWork& work) {
  const auto one = std::find(work.present.begin(), work.present.end(), true);
  if (one == work.present.end() || std::count(one, work.present.end(), true) != 1) return false;
  const std::optional<LensCheck>& lens = work.checks[static_cast<size_t>(one - work.present.begin())].lens;
  return lens && lens->status == Status::kOk;
}

}  // namespace internal
}  // namespace mvstudio::calib
