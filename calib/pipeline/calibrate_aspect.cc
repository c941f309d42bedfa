#include <cmath>
#include <limits>

#include "calib/pipeline/calibrate_steps.h"

namespace mvstudio::calib::internal {
namespace {

double AspectOf(const geometry::Camera& lens) { return std::log(lens.fx() / lens.fy()); }

}  // namespace

void ReportAspect(const std::vector<Board>& boards, const HeldCovariance& held, const Work& work, CalibrateReport* report) {
  constexpr double kSquare = 0.005;  // below it nobody takes pixels or cells for anything else
  const bool in_space = boards[0].kind == Board::Kind::kPoints;
  RigState state = work.state;
  BundleOptions options = work.bundle;
  bool doubtful = false;
  for (size_t c = 0; c < state.cameras.size(); ++c)
    doubtful |= !options.fix_lens[c] && std::abs(AspectOf(state.cameras[c])) > kSquare;
  for (const Eigen::Vector2d& stretch : state.board_stretch) doubtful |= std::abs(stretch.y()) > kSquare;
  if (!doubtful || in_space) return;
  options.refine_stretch = true;
  if (state.board_stretch.empty()) state.board_stretch.assign(state.rig_from_board.size(), Eigen::Vector2d::Zero());
  const RigCovariance covariance = ComputeCovariance(work.evidence, state, options, report->sigma_px, held);
  for (size_t c = 0; c < state.cameras.size(); ++c) {
    if (options.fix_lens[c]) continue;
    const geometry::Camera& lens = state.cameras[c];
    double& sigma = report->cameras[c].aspect_sigma = std::numeric_limits<double>::infinity();
    if (covariance.status != Status::kOk) continue;
    const Eigen::Vector2d d(1 / lens.fx(), -1 / lens.fy());
    sigma = std::sqrt(std::fmax(0.0, d.dot(covariance.params[c].topLeftCorner<2, 2>() * d)));
  }
}

}  // namespace mvstudio::calib::internal
