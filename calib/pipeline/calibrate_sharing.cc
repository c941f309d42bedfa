#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "calib/lens/evidence.h"
#include "calib/pipeline/calibrate_steps.h"
#include "calib/verdict/judgement.h"
#include "core/format.h"

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

void AssumeSharing(const std::string& why, CalibrateReport* report) {
  for (CameraReport& camera : report->cameras) {
    if (camera.shares_lens_with.empty()) continue;
    camera.given_up =
        "a lens of its own, as its corners call for, given up for one with " + camera.shares_lens_with + ": " + why;
    camera.assumes = true;
  }
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

namespace {

/// Mean squared error of all corners, rejected ones too, in units of their cameras' own, each at most kCapSigmas.
double MeanRelativeSquare(const CalibrateReport& report) {
  double sum = 0;
  for (const CornerResidual& corner : report.residuals) {
    const double own = std::max(1e-3, report.cameras[static_cast<size_t>(corner.camera_idx)].alone_rms_px);
    sum += std::pow(std::fmin(kCapSigmas, corner.residual_px.norm() / own), 2);
  }
  return sum / std::max<double>(1, static_cast<double>(report.residuals.size()));
}

/// A camera that the rig explains far worse than it explains itself, or not at all.
bool Contradictory(const CalibrateReport& report, const CameraReport& camera) {
  constexpr double kLost = 0.05, kRejected = 0.10;
  const auto c = static_cast<size_t>(&camera - report.cameras.data());
  const double excess = camera.rms_px - camera.alone_rms_px;
  const bool off = camera.rms_px > kContradictsRatio * camera.alone_rms_px && excess > kContradictsPx * PixelScale(report, c);
  return off || camera.num_lost_views > kLost * (camera.num_views + camera.num_lost_views) ||
         camera.num_rejected > kRejected * (camera.num_corners + camera.num_rejected);
}

bool AnyContradictory(const CalibrateReport& report) {
  return std::any_of(report.cameras.begin(), report.cameras.end(),
                     [&](const CameraReport& camera) { return Contradictory(report, camera); });
}

}  // namespace

bool DoubtfulBoards(const CalibrateInput& input, const CalibrateOptions& options, const CalibrateReport& rigid) {
  if (options.free_boards != AutoOnOff::kAuto || options.intrinsics_only || input.boards.size() < 2) return false;
  return rigid.status != Status::kOk || AnyContradictory(rigid);
}

bool FreeBoardsPay(const CalibrateReport& rigid, CalibrateReport* free) {
  constexpr double kDecisive = 0.5;  // of the mean squared error
  if (free->status != Status::kOk || free->board_moves.empty()) return false;
  const bool solved = rigid.status == Status::kOk;
  const bool pays = solved ? MeanRelativeSquare(*free) < kDecisive * MeanRelativeSquare(rigid) : !AnyContradictory(*free);
  if (!pays) return false;
  free->boards_moved = "the boards are not rigid to each other: " + ToString(free->board_moves) +
                       "; each has a place of its own in every time step now, ";
  free->boards_moved +=
      solved ? Format("which leaves %.2f px instead of %.2f px and %.0f %% of the corners rejected instead of %.0f %%",
                      free->rms_px, rigid.rms_px, 100 * free->rejected_fraction, 100 * rigid.rejected_fraction)
             : Format("which leaves %.2f px; rigid, they had no solution", free->rms_px);
  return true;
}

}  // namespace mvstudio::calib::internal
