#include "cli/people/take_timing.h"

#include "dataset/session/timeline_source.h"
#include "stages/calib/calibration_use.h"
#include "stages/input/take_frames.h"
#include "stages/input/take_input.h"
#include "stages/people/apply_sync.h"

namespace mvstudio::cli {
namespace {

/// Frame numbers become instants, as everything later counts them. Offsets of a sync file are kept to a fraction of a frame;
/// else each camera's nearest frame is taken. False when nothing of the session says how the cameras' clocks relate.
bool ApplySession(const stages::FoundTake& found, const TimingArguments& timing, stages::PoseInput* input,
                  FrameNumbering* numbering, CommandResult* result) {
  const auto timeline = stages::TimelineOf(found.session, found.take, timing.session.allow_outside, true, result);
  const std::string sync = dataset::SyncPathOf(found.session, found.take, timing.session.allow_outside);
  if (!timing.sync.empty() || (timeline && timeline->clock == dataset::TimelineClock::kOffsets && !sync.empty())) {
    stages::RenumberByClock(found, timing.session, input);
    input->frames = stages::ToFrames(input->tracks, input->rig, timing.calib);
    stages::ApplySync(timing.sync.empty() ? sync : timing.sync, input, result);
    numbering->in_footage = timeline != nullptr;
    numbering->timeline = timeline;
    return true;
  }
  if (!timeline) return false;
  if (stages::RenumberByTimeline(*timeline, input)) input->frames = stages::ToFrames(input->tracks, input->rig, timing.calib);
  numbering->timeline = timeline;
  return timeline->clock != dataset::TimelineClock::kStart;
}

}  // namespace

FrameNumbering ApplyTiming(const std::optional<stages::FoundTake>& found, const TimingArguments& timing,
                           const triangulate::TakeOptions& options, const RunContext& run, stages::PoseInput* input,
                           CommandResult* result) {
  FrameNumbering numbering;
  bool stated = !timing.sync.empty();
  if (found) {
    stated = ApplySession(*found, timing, input, &numbering, result);
  } else if (stated) {
    stages::ApplySync(timing.sync, input, result);
    numbering.in_footage = false;
  }
  if (stated) {
    stages::ReportOffsetsUnused(input->rig, "the take states its own timing", result);
    return numbering;
  }
  stages::ApplyCalibrationOffsets(timing.calibration_offsets, options, run, input, result);
  const auto offsets = result->metrics.find("calibration_offsets");
  if (offsets != result->metrics.end() && offsets->value("applied", false)) numbering.in_footage = false;
  return numbering;
}

}  // namespace mvstudio::cli
