#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dataset/time/sync_file.h"

/// The frame of each camera at each time step of a take. Time steps are the ticks of the reference camera's clock from its
/// first frame on, including ticks of dropped frames. Time step i is frame i of a reference without dropped frames, even
/// if its first image has a number other than 0.
namespace mvstudio::dataset {

/// The frames of one camera's footage, in order.
struct CameraTimes {
  std::string camera;
  std::string source;                      ///< path, for messages
  std::vector<int64_t> frame;              ///< number of each frame, ascending: position in a video, number in an image's name
  std::vector<double> time_s;              ///< NaN where there is no time stamp
  std::vector<int64_t> repeats;            ///< frames that show the same image as the previous one
  std::optional<double> origin_s;          ///< time of its time step 0; none: that of its first frame
  std::optional<double> time_code_s = {};  ///< time of day of its first frame by a time code, which counts whole frames
};

/// Relation between the cameras' clocks.
enum class TimelineClock {
  kCommon,   ///< the time stamps are on one clock
  kOffsets,  ///< each camera has its own clock; offsets are given
  kStart,    ///< unknown: all cameras are assumed to start at the same time
};
/// "common", "offsets", "start"
std::string ToString(TimelineClock clock);

struct TimelineOptions {
  std::string reference;       ///< empty: the sync file's, else the first camera
  double max_residual_ms = 0;  ///< a time step farther from a frame than this has none; 0: half a frame of that camera
  double jitter_limit = 0.25;  ///< frame periods; time stamps with a larger RMS distance from their clock's line are used
                               ///< unchanged
};

/// `count` frames are missing after frame `after`.
struct DroppedFrames {
  int64_t after = 0;
  int64_t count = 0;
};

/// What is known of a camera's clock.
enum class ClockStatus {
  kOk,
  kVariable,  ///< no regular clock
  kNoTime,    ///< no usable time stamps
  kNoOffset,  ///< no relation to the reference's
};
std::string_view ToString(ClockStatus status);  ///< "Ok", "Variable", "NoTime", "NoOffset"
std::optional<ClockStatus> ClockStatusFromString(std::string_view text);

struct CameraTimeline {
  std::string name;
  std::string source;
  ClockStatus status = ClockStatus::kOk;
  int64_t num_frames = 0;
  double fps_hz = 0;         ///< of its clock
  double offset_frames = 0;  ///< at time step 0 it shows its tick `offset_frames`, as in a sync file
  double sigma_frames = 0;
  double rate_ppm = 0;  ///< its period relative to the reference's (or to its own nominal rate's when those differ)
  double rate_sigma_ppm = 0;
  double jitter_ms = 0;  ///< RMS of time stamps about the clock's line
  std::vector<DroppedFrames> dropped;
  std::vector<int64_t> doubled;    ///< frames with the time stamp or the image of the previous one: not used
  std::vector<int64_t> bad_times;  ///< frames whose time stamp is missing or contradicts the others
  std::vector<int64_t> frame_at;   ///< (num_time_steps) frame number, -1: none
  std::vector<double>
      residual_s;  ///< (num_time_steps) time of the frame minus that of the time step; NaN: none. Empty when read from a file
  double residual_median_ms = 0, residual_max_ms = 0;  ///< of their absolute values
};

struct Timeline {
  std::string take;
  std::string reference;
  TimelineClock clock = TimelineClock::kStart;
  double fps_hz = 0;   ///< time steps per second
  double start_s = 0;  ///< time of time step 0 on the reference's clock
  int64_t num_time_steps = 0;
  std::vector<CameraTimeline> cameras;

  const CameraTimeline* Find(const std::string& camera) const;  ///< nullptr: not there
};

/// Fits each camera's clock robustly to its time stamps as a line, time = start + period * tick. Ticks are counted across
/// gaps, so that a dropped frame leaves a tick without frame. Each time step's frame is the one of the nearest tick.
///
/// Throws UsageError (unknown reference), FormatError (the reference has no usable times). Cameras without usable times or
/// offset are listed with their status and have no frame at any time step. `sync`: offsets, used unless `clock` is
/// kCommon.
Timeline BuildTimeline(const std::vector<CameraTimes>& cameras, TimelineClock clock, const SyncFile* sync,
                       const TimelineOptions& options = {});

/// `mvstudio.timeline/1`, atomically; the same bytes for the same timeline.
void WriteTimeline(const Timeline& timeline, const std::string& path);
/// Throws IoError, FormatError (path, place).
Timeline ReadTimeline(const std::string& path);

/// The time step of each frame number, (frame number, time step) ascending by frame; frames used for several time steps
/// have several rows.
std::vector<std::pair<int64_t, int64_t>> TimeStepsOfFrames(const CameraTimeline& camera);

/// The time step of each frame number. A frame that is the nearest one of several time steps has the one nearest to it, or
/// the middle one where the timeline comes from a file.
std::map<int64_t, int64_t> TimeStepOfEachFrame(const CameraTimeline& camera);

/// (frame number, tick of the camera's own clock) ascending by frame, for the frames that have one. The tick is the
/// position if no frame had been dropped or doubled. Images keep their numbers; so do the frames of a camera without a
/// regular clock.
std::vector<std::pair<int64_t, int64_t>> TicksOfFrames(const CameraTimes& camera);

/// Offsets of the cameras from their times on a common clock, as a sync file: frame numbers count ticks of each clock from
/// its first frame. Those without times are "NoTime".
SyncFile SyncFromTimeline(const Timeline& timeline);

}  // namespace mvstudio::dataset
