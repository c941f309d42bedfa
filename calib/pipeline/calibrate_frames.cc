#include "calib/pipeline/calibrate_steps.h"
#include "calib/rig/frame_rate.h"
#include "geometry/rig/rig.h"

namespace mvstudio::calib::internal {

bool CheckFrames(const CalibrateOptions& options, const BoardTurns& turns, Work* work, CalibrateReport* report) {
  if (work->monos.size() < 2) return true;
  const std::vector<std::string> names = geometry::CameraNames(work->state.cameras);
  work->offsets = FindFrameOffsets(work->views, work->cam_from_board, work->frames, names, {turns});
  const FrameOffsets& offsets = work->offsets;
  if (offsets.kind == FrameOffsets::Kind::kInconsistent) {
    report->frames_doubt = offsets.text;
    if (options.time_offset != LatenessChoice::kNone && options.seek_frame_rates)
      report->frame_rates = FindFrameRates(work->views, work->cam_from_board, work->frames, offsets, turns);
    if (!report->frame_rates.empty()) {
      Stop(Status::kDegenerate, ToString(report->frame_rates, names), report);
      return false;
    }
  }
  if (offsets.kind != FrameOffsets::Kind::kShifted) return true;
  report->frame_shift = offsets.shift;
  if (options.time_offset != LatenessChoice::kNone) work->shift = offsets.shift;
  Stop(Status::kDegenerate, offsets.text + (offsets.hint.empty() ? "" : "; " + offsets.hint), report);
  return false;
}

void ReconsiderFrames(const Work& work, CalibrateReport* report) {
  constexpr double kWorse = 2, kSlackPx = 0.05;
  if (work.offsets.kind != FrameOffsets::Kind::kInconsistent) return;
  std::vector<bool> explained;
  for (size_t c = 0; c < work.monos.size(); ++c)
    explained.push_back(report->cameras[c].rms_px <= kWorse * work.monos[c].bundle.rms_px + kSlackPx);
  FrameOffsets offsets = work.offsets;
  Reconsider(work.views, work.prior, BundleResiduals(work.views, work.state), geometry::CameraNames(work.state.cameras),
             explained, &offsets);
  report->frames_doubt = offsets.text;
}

}  // namespace mvstudio::calib::internal
