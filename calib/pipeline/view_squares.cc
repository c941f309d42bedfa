#include "calib/pipeline/view_squares.h"

#include <algorithm>
#include <map>
#include <utility>

namespace mvstudio::calib {
namespace {

using ViewKey = std::pair<int, int64_t>;  // camera, frame

std::map<ViewKey, double> SquaresOfViews(const CalibrateReport& report, const std::vector<CameraReport>& reference) {
  constexpr double kCapSigmas = 6;
  std::map<ViewKey, double> squares;
  for (const CornerResidual& corner : report.residuals) {
    const double sigma = reference[static_cast<size_t>(corner.camera_idx)].sigma_px;
    if (!(sigma > 0)) continue;
    const double relative = std::min(kCapSigmas, corner.residual_px.norm() / sigma);
    squares[{corner.camera_idx, corner.frame_idx}] += relative * relative;
  }
  return squares;
}

}  // namespace

std::vector<double> ChiSquaredGain(const CalibrateReport& lean, const CalibrateReport& rich) {
  const auto before = SquaresOfViews(lean, rich.cameras), after = SquaresOfViews(rich, rich.cameras);
  std::vector<double> differences;
  for (const auto& [view, value] : before) {
    if (const auto found = after.find(view); found != after.end()) differences.push_back(value - found->second);
  }
  return differences;
}

}  // namespace mvstudio::calib
