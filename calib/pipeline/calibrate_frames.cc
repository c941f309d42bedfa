#include <algorithm>
#include <cstdlib>

#include "calib/pipeline/calibrate_steps.h"
#include "calib/pipeline/split_trial.h"
#include "calib/rig/frame_drops.h"
#include "calib/rig/frame_rate.h"
#include "geometry/rig/rig.h"

namespace mvstudio::calib::internal {
namespace {

/// Whether every camera's corners are about as near as by itself, and none of its boards is lost.
bool AllExplained(const CalibrateReport& report) {
  constexpr double kWorse = 1.2, kSlackPx = 0.02, kMostRejected = 0.02;
  return std::all_of(report.cameras.begin(), report.cameras.end(), [&](const CameraReport& camera) {
    return camera.rms_px <= kWorse * camera.alone_rms_px + kSlackPx && camera.num_lost_views == 0 &&
           camera.num_rejected <= kMostRejected * (camera.num_rejected + camera.num_corners);
  });
}

/// Of the cameras that lost frames: another may have moved.
double MeanCapped(CalibrateReport report, const CalibrateReport& plain, const std::vector<FrameDrop>& drops) {
  const auto of_others = [&](const CornerResidual& corner) {
    return std::none_of(drops.begin(), drops.end(),
                        [&](const FrameDrop& drop) { return drop.camera_idx == corner.camera_idx; });
  };
  auto& residuals = report.residuals;
  residuals.erase(std::remove_if(residuals.begin(), residuals.end(), of_others), residuals.end());
  return CappedSquares(report, plain, 0) / static_cast<double>(std::max<size_t>(1, report.residuals.size()));
}

/// Motions of a single camera as its own frames are numbered.
template <class OwnFrame>
void NumberMotions(CalibrateReport* report, const OwnFrame& own) {
  for (CameraMotion& motion : report->motions) {
    const int camera = motion.cameras.size() == 1 ? report->rig.Find(motion.cameras[0]) : -1;
    if (camera < 0) continue;
    motion.frame_idx = own(camera, motion.frame_idx);
    motion.last_before = own(camera, motion.last_before);
  }
}

}  // namespace

bool OtherNumbers(const CalibrateReport& report) { return !report.frame_rates.empty() || !report.frame_drops.empty(); }

bool CheckFrames(const CalibrateOptions& options, const BoardTurns& turns, Work* work, CalibrateReport* report) {
  if (work->monos.size() < 2) return true;
  const std::vector<std::string> names = geometry::CameraNames(work->state.cameras);
  work->offsets = FindFrameOffsets(work->views, work->cam_from_board, work->frames, names, {turns});
  const FrameOffsets& offsets = work->offsets;
  if (offsets.kind == FrameOffsets::Kind::kInconsistent) {
    report->frames_conflict = offsets.text;
    if (options.time_offset != TimeOffsetChoice::kNone && options.seek_numbers) {
      report->frame_rates = FindFrameRates(work->views, work->cam_from_board, work->frames, offsets, turns);
      if (report->frame_rates.empty()) report->frame_drops = FindFrameDrops(offsets);
    }
    if (OtherNumbers(*report)) {
      Stop(Status::kDegenerate, ToString(report->frame_rates, names) + ToString(report->frame_drops, names), report);
      return false;
    }
  }
  if (offsets.kind != FrameOffsets::Kind::kShifted) return true;
  report->frame_shift = offsets.shift;
  if (options.time_offset != TimeOffsetChoice::kNone) work->shift = offsets.shift;
  Stop(Status::kDegenerate, offsets.text + (offsets.hint.empty() ? "" : "; " + offsets.hint), report);
  return false;
}

CalibrateInput WithNumbers(CalibrateInput input, const CalibrateReport& found) {
  if (!found.frame_rates.empty()) ApplyFrameRates(found.frame_rates, &input.detections);
  ApplyFrameDrops(found.frame_drops, &input.detections);
  return input;
}

bool DoubtfulNumbers(const CalibrateReport& found, const CalibrateReport& again) {
  return again.status != Status::kOk || !again.frames_conflict.empty() || (!found.frame_drops.empty() && !AllExplained(again));
}

bool NumbersPay(const CalibrateReport& found, const CalibrateReport& again, const CalibrateReport& plain) {
  constexpr double kClearly = 0.7;
  const auto single = [](const FrameDrop& drop) { return std::llabs(drop.count) < 2; };
  const auto& drops = found.frame_drops;
  if (std::any_of(drops.begin(), drops.end(), single) && !AllExplained(again)) return false;
  if (again.status != Status::kOk || plain.status != Status::kOk) return again.status == Status::kOk;
  if (drops.empty()) return again.rms_px <= kClearly * plain.rms_px;
  return MeanCapped(again, plain, drops) <= kClearly * MeanCapped(plain, plain, drops);
}

void StateNumbers(const CalibrateReport& found, CalibrateReport* again) {
  again->frame_rates = found.frame_rates;
  again->frame_drops = found.frame_drops;
  NumberMotions(again, [&](int c, int64_t frame) { return FrameBeforeDrops(found.frame_drops, c, frame); });
  again->frames_conflict =
      found.message + "; they were renumbered" + (again->frames_conflict.empty() ? "" : "; " + again->frames_conflict);
}

void StateShift(const std::vector<int64_t>& shift, const std::string& message, CalibrateReport* again) {
  again->frame_shift = shift;
  NumberMotions(again, [&](int c, int64_t frame) { return frame - shift[static_cast<size_t>(c)]; });
  if (again->frames_conflict.empty()) again->frames_conflict = message + "; they were added";
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
  report->frames_conflict = offsets.text;
}

}  // namespace mvstudio::calib::internal
