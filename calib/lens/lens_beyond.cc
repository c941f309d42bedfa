#include "calib/lens/lens_beyond.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/bundle/view_clusters.h"
#include "calib/covariance/omitted_terms.h"
#include "calib/covariance/projection_uncertainty.h"
#include "calib/lens/lens_configs.h"
#include "core/format.h"
#include "geometry/rig/plausible.h"

namespace mvstudio::calib {
namespace {

using Level = BeyondBoards::Level;

/// The views as evidence: boards that were held still count for what they are worth.
std::vector<View> EvidenceOf(const LensPool& fit) {
  const auto correlation =
      RepeatCorrelation(fit.views, fit.cluster, BundleResiduals(fit.views, fit.state), fit.state.cameras.size());
  return DiscountRepeats(fit.views, fit.cluster, correlation);
}

UncertaintySummary UncertaintyOf(const LensPool& fit, const BundleOptions& options) {
  BundleOptions bundle = options;
  bundle.gauge = {Gauge::Kind::kNone, 0};
  bundle.refine_cameras = bundle.refine_boards = bundle.refine_time = false;
  bundle.refine_warp = fit.config.warp, bundle.refine_stretch = fit.config.stretch;
  bundle.fix_lens.clear(), bundle.fix_camera.clear();
  const std::vector<bool> chosen(fit.state.cameras.size(), true);
  const WithOmitted considered = AddOmittedTerms(fit.state, bundle, chosen, fit.bundle.sigma_px);
  return ProjectionUncertainty(EvidenceOf(fit), considered.state, considered.options, fit.bundle.sigma_px).Summarize();
}

/// Beyond the circle of a wide lens there is no image to be uncertain of.
Level LevelOf(const CameraUncertainty& camera, const PixelLimits& limits, bool wide) {
  if (!(camera.edge_px <= limits.fail_side_px)) return wide && std::isnan(camera.edge_px) ? Level::kWarn : Level::kFail;
  if (camera.edge_px > limits.side_px || (!wide && camera.corner_px > limits.corner_px)) return Level::kWarn;
  return Level::kPass;
}

std::string Loss(const LensCandidate& candidate, double best_error) {
  if (!std::isfinite(candidate.relative_error) || !std::isfinite(best_error)) return "";
  return Format(", held-out error %+.1f %%", 100 * (candidate.relative_error / best_error - 1));
}

std::string Figures(const LensCandidate& candidate, const BeyondBoards& beyond, double best_error) {
  return ToString(candidate.config) + " (" + ToString(beyond) + Loss(candidate, best_error) + ")";
}

/// Whether it fails by less where no board was.
bool IsNearer(const BeyondBoards& a, const BeyondBoards& b) {
  if (a.level != b.level) return a.level < b.level;
  if (std::abs(a.folded - b.folded) > kFoldSlack) return a.folded < b.folded;
  return a.side_px < b.side_px || (std::isnan(b.side_px) && !std::isnan(a.side_px));
}

/// Whether a lens gives no ray for more than a tenth of an image, or has a decentring that no lens has. Then its smaller error
/// on boards elsewhere is worth less.
bool IsSpoiled(const LensCandidate& candidate) {
  constexpr double kMuch = 0.1;
  const auto& cameras = candidate.fit.state.cameras;
  return std::any_of(cameras.begin(), cameras.end(), [](const geometry::Camera& camera) {
    return !geometry::HasLensDecentring(camera) || (!geometry::IsWide(camera.model) && FindFolds(camera).share > kMuch);
  });
}

bool IsSound(const BeyondBoards& beyond) { return beyond.is_lens && beyond.folded <= kFoldSlack; }

/// Simpler, and no less honest where no board was: the curves of one or two parameters of other wide lenses claim to know
/// what is there.
bool MayReplace(const LensCandidate& candidate, const LensCandidate& chosen) {
  using geometry::LensModel;
  const int cameras = static_cast<int>(candidate.fit.state.cameras.size());
  if (NumLensParams(candidate.config, cameras) >= NumLensParams(chosen.config, cameras)) return false;
  const LensModel model = candidate.config.model;
  return !geometry::IsWide(model) || model == LensModel::kKannalaBrandt4 || model == LensModel::kKannalaBrandt4P ||
         model == chosen.config.model;
}

}  // namespace

std::vector<bool> NearTheBest(const std::vector<LensCandidate>& candidates, int chosen) {
  constexpr double kOfSound = 0.02, kOfSpoiled = 0.1;
  const double barely = IsSpoiled(candidates[static_cast<size_t>(chosen)]) ? kOfSpoiled : kOfSound;
  double best = std::numeric_limits<double>::infinity();
  for (const LensCandidate& candidate : candidates) best = std::min(best, candidate.relative_error);
  std::vector<bool> near;
  for (const LensCandidate& candidate : candidates)
    near.push_back(candidate.within_one_se || candidate.relative_error <= (1 + barely) * best);
  return near;
}

bool IsSafer(const BeyondBoards& a, const BeyondBoards& b) {
  if (a.level != b.level) return a.level < b.level;
  return a.level == Level::kWarn && IsSound(a) && !IsSound(b);
}

BeyondBoards JudgeBeyond(const LensPool& fit, const BundleOptions& options, double need_px) {
  BeyondBoards beyond;
  const UncertaintySummary uncertainty = UncertaintyOf(fit, options);
  beyond.side_px = uncertainty.edge_px;
  for (size_t c = 0; c < fit.state.cameras.size(); ++c) {
    const geometry::Camera& camera = fit.state.cameras[c];
    const bool wide = geometry::IsWide(camera.model);
    beyond.level = std::max(beyond.level, LevelOf(uncertainty.cameras[c], PixelLimitsOf(camera, need_px), wide));
    if (!geometry::HasLensDecentring(camera)) beyond.is_lens = false, beyond.level = std::max(beyond.level, Level::kWarn);
    if (wide) continue;
    beyond.folded = std::max(beyond.folded, FindFolds(camera).share);
    if (beyond.folded > kFoldSlack) beyond.level = std::max(beyond.level, Level::kWarn);
  }
  return beyond;
}

std::string ToString(const BeyondBoards& beyond) {
  const std::string sides = Format("%.2f px uncertain at the image's sides", beyond.side_px);
  const std::string decentred = beyond.is_lens ? "" : ", with a decentring that no lens has";
  return beyond.folded > kFoldSlack ? sides + Format(", folded in %.0f %% of the image", 100 * beyond.folded) + decentred
                                    : sides + decentred;
}

int PassingLens(const std::vector<LensCandidate>& candidates, const std::vector<bool>& near, int chosen,
                const BundleOptions& options, double need_px, std::string* note) {
  const LensCandidate& of_chosen = candidates[static_cast<size_t>(chosen)];
  const BeyondBoards wanted = JudgeBeyond(of_chosen.fit, options, need_px);
  if (wanted.level == Level::kPass) return chosen;
  int taken = chosen, closest = chosen;
  BeyondBoards of_taken = wanted, of_closest = wanted;
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (!near[i] || !MayReplace(candidates[i], of_chosen)) continue;
    const BeyondBoards beyond = JudgeBeyond(candidates[i].fit, options, need_px);
    if (IsSafer(beyond, of_taken)) taken = static_cast<int>(i), of_taken = beyond;
    if (IsNearer(beyond, of_closest)) closest = static_cast<int>(i), of_closest = beyond;
  }
  const double best_error = of_chosen.relative_error;
  if (taken != chosen) {
    *note = Figures(candidates[static_cast<size_t>(taken)], of_taken, best_error) + " in place of " +
            ToString(of_chosen.config) + " (" + ToString(wanted) + ")";
  } else if (closest != chosen) {
    *note =
        "of the simpler lenses " + Figures(candidates[static_cast<size_t>(closest)], of_closest, best_error) + " comes nearest";
  }
  return taken;
}

}  // namespace mvstudio::calib
