#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "calib/calibrate_steps.h"
#include "calib/lens/evidence.h"

namespace mvstudio::calib::internal {
namespace {

constexpr double kCapSigmas = 6, kMinStandardErrors = 3;

/// Squared residuals of every view in standard deviations of its camera, capped.
std::vector<double> SquaresOfViews(const Work& work, const std::vector<double>& sigmas_px) {
  const auto residuals = BundleResiduals(work.views, work.state);
  std::vector<double> squares(work.views.size(), 0);
  for (size_t v = 0; v < work.views.size(); ++v) {
    const View& view = work.views[v];
    const double sigma = sigmas_px[static_cast<size_t>(view.camera_idx)];
    if (!(sigma > 0)) continue;
    for (Eigen::Index i = 0; i < view.size(); ++i)
      squares[v] += std::pow(std::fmin(kCapSigmas, residuals[v].col(i).norm() / sigma), 2);
  }
  return squares;
}

/// How many numbers the lenses have.
int NumLensNumbers(const RigState& state) {
  std::set<int> counted;
  int numbers = 0;
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    if (counted.insert(state.lens_group[c]).second) numbers += static_cast<int>(state.cameras[c].params.size());
  }
  return numbers;
}

/// Do lenses of their own explain the rig's corners by more than they cost (Schwarz), and not a few views alone?
bool Pays(const Work& shared, const Work& separate, const std::vector<double>& sigmas_px) {
  std::vector<double> differences = SquaresOfViews(shared, sigmas_px);
  const std::vector<double> apart = SquaresOfViews(separate, sigmas_px);
  double corners = 0;
  for (size_t v = 0; v < apart.size(); ++v) {
    differences[v] -= apart[v];
    corners += static_cast<double>(shared.views[v].size());
  }
  const double cost = (NumLensNumbers(separate.state) - NumLensNumbers(shared.state)) * std::log(std::max(2.0, corners));
  return GainBeyondCost(differences, cost, kMinStandardErrors).has_value();
}

}  // namespace

std::optional<BundleReport> SeparateLenses(const CalibrateInput& input, const CalibrateOptions& options, Work* work,
                                           CalibrateReport* report) {
  const std::set<int> groups(work->state.lens_group.begin(), work->state.lens_group.end());
  const bool shared = !work->state.lens_group.empty() && groups.size() < work->state.cameras.size();
  if (!shared || !work->may_separate || options.share_intrinsics.kind != LensSharing::Kind::kAuto || !input.same_lens.empty() ||
      options.engine != Engine::kMvstudio)
    return std::nullopt;
  Work separate = *work;
  std::iota(separate.state.lens_group.begin(), separate.state.lens_group.end(), 0);
  BundleReport solved = SolveBundle(&separate.views, &separate.state, separate.bundle);
  const bool usable = solved.status == Status::kOk || solved.status == Status::kNotConverged;
  if (!usable || solved.camera_sigma_px.size() != work->state.cameras.size()) return std::nullopt;
  if (!Pays(*work, separate, solved.camera_sigma_px)) return std::nullopt;
  *work = std::move(separate);
  work->separated = true;
  GiveLensesOfTheirOwn(work, report);
  return solved;
}

void GiveLensesOfTheirOwn(Work* work, CalibrateReport* report) {
  std::iota(work->state.lens_group.begin(), work->state.lens_group.end(), 0);
  work->may_separate = false;
  for (CameraReport& camera : report->cameras) {
    if (camera.shares_lens_with.empty()) continue;
    camera.model_reason += "; a lens of its own, as the rig's corners call for one (Schwarz's criterion)";
    camera.shares_lens_with.clear();
  }
}

}  // namespace mvstudio::calib::internal
