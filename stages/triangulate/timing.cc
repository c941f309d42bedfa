#include "stages/triangulate/timing.h"

#include "dataset/session/timeline_source.h"
#include "stages/input/take_frames.h"
#include "stages/input/take_input.h"
#include "stages/people/apply_sync.h"

namespace mvstudio::stages {
namespace {

/// Frame numbers become time steps, as everything later counts them. Offsets of a sync file are kept to a fraction of a frame;
/// else each camera's nearest frame is taken. False when nothing of the session says how the cameras' clocks relate.
bool ApplySessionTiming(const FoundTake& found, const TriangulateOptions& options, PoseInput* input, TakeTiming* timing,
                        InputNotes* notes) {
  const bool allow_outside = options.session.allow_outside;
  const auto timeline = TimelineOf(found.session, found.take, allow_outside, true, notes);
  const std::string sync = dataset::SyncPathOf(found.session, found.take, allow_outside);
  if (!options.sync.empty() || (timeline && timeline->clock == dataset::TimelineClock::kOffsets && !sync.empty())) {
    RenumberByClock(found, options.session, input);
    input->frames = ToFrames(input->tracks, input->rig, options.pose.calib);
    ApplySync(options.sync.empty() ? sync : options.sync, input, notes);
    timing->in_footage = timeline != nullptr;
    timing->timeline = timeline;
    return true;
  }
  if (!timeline) return false;
  if (RenumberByTimeline(*timeline, input)) input->frames = ToFrames(input->tracks, input->rig, options.pose.calib);
  timing->timeline = timeline;
  return timeline->clock != dataset::TimelineClock::kStart;
}

}  // namespace

TakeTiming ApplyTiming(const std::optional<FoundTake>& found, const TriangulateOptions& options, const RunContext& run,
                       PoseInput* input, InputNotes* notes) {
  TakeTiming timing;
  bool stated = !options.sync.empty();
  if (found) {
    stated = ApplySessionTiming(*found, options, input, &timing, notes);
  } else if (stated) {
    ApplySync(options.sync, input, notes);
    timing.in_footage = false;
  }
  if (stated) {
    timing.offsets = OffsetsUnused(input->rig, "the take states its own timing");
    return timing;
  }
  timing.offsets = ApplyCalibrationOffsets(options.calibration_offsets, options.points, run, input, notes);
  if (timing.offsets && timing.offsets->applied) timing.in_footage = false;
  return timing;
}

}  // namespace mvstudio::stages
