#include "calib/pipeline/split_trial.h"

#include <cmath>
#include <limits>
#include <set>

#include "calib/pipeline/calibrate_steps.h"

namespace mvstudio::calib {
namespace {

constexpr double kCapSigmas = 6;

/// The rig as the start of the split one: both parts as the camera was.
geometry::Rig StartOf(const geometry::Rig& rig, const std::string& camera, const std::string& later) {
  geometry::Rig start = rig;
  geometry::RigCamera part = rig.cameras[static_cast<size_t>(rig.Find(camera))];
  part.camera.name = later;
  start.cameras.push_back(part);
  return start;
}

/// Offsets, and rates, are estimated anew where the solution has them: those of a rig that a motion bent are bent with it.
TimeOffsetChoice TimeOffsetIn(const CalibrateReport& solved) {
  TimeOffsetChoice time_offset = TimeOffsetChoice::kNone;
  for (const CameraReport& camera : solved.cameras) {
    if (camera.time_rate != 0) return TimeOffsetChoice::kClocks;
    if (camera.time_offset_frames != 0) time_offset = TimeOffsetChoice::kOn;
  }
  return time_offset;
}

}  // namespace

CalibrateReport AdjustSplit(const CalibrateInput& input, const CalibrateReport& solved, CalibrateOptions options,
                            const CameraSplit& split, const RunContext& run) {
  options.motions = options.seek_numbers = false;
  options.share_intrinsics = {LensSharing::Kind::kNone, {}};
  options.time_offset = TimeOffsetIn(solved);
  options.holdout = {};
  options.holdout_folds = 0;
  options.warp = solved.board_warp_m.empty() || solved.board_warp_m[0].isZero() ? AutoOnOff::kOff : AutoOnOff::kOn;
  options.stretch = solved.board_stretch.empty() ? AutoOnOff::kOff : AutoOnOff::kOn;
  options.split_at = {split};
  CalibrateInput parts = input;
  parts.start = StartOf(solved.rig, split.camera, internal::LaterName(split));
  return Calibrate(parts, options, run);
}

double CappedSquares(const CalibrateReport& report, const CalibrateReport& solved, size_t camera) {
  if (report.status != Status::kOk) return std::numeric_limits<double>::infinity();
  double sum = 0;
  for (const CornerResidual& corner : report.residuals) {
    const size_t of =
        static_cast<size_t>(corner.camera_idx) < solved.cameras.size() ? static_cast<size_t>(corner.camera_idx) : camera;
    const double relative = corner.residual_px.norm() / solved.cameras[of].alone_rms_px;
    sum += std::pow(std::fmin(kCapSigmas, relative), 2);
  }
  return sum;
}

std::vector<int64_t> FramesWithBoards(const CalibrateInput& input, int camera) {
  std::set<int64_t> frames;
  for (const Detection& d : input.detections) {
    if (d.camera_idx == camera) frames.insert(d.frame_idx);
  }
  return {frames.begin(), frames.end()};
}

}  // namespace mvstudio::calib
