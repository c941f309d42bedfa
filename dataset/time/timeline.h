#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dataset/time/sync_file.h"

/// Which frame of each camera shows each instant of a take. Instants are the ticks of the reference camera's clock from its
/// first frame on, whether or not it kept the frame: instant i is frame i of a reference that dropped none, also where its
/// first picture has another number than 0.
namespace mvstudio::dataset {

/// The frames of one camera's footage, in order.
struct CameraTimes {
  std::string camera;
  std::string source;              ///< path, for messages
  std::vector<int64_t> frame;      ///< number of each frame, ascending: position in a video, number in a picture's name
  std::vector<double> time_s;      ///< NaN where there is no time stamp
  std::vector<int64_t> repeats;    ///< frames that show the same picture as the one before
  std::optional<double> origin_s;  ///< time of its instant 0; none: that of its first frame
};

/// What relates the cameras' clocks.
enum class TimelineClock {
  kCommon,   ///< the time stamps are of one clock
  kOffsets,  ///< each camera has its own, offsets are given
  kStart,    ///< nothing: all cameras are taken to have started at the same instant
};
/// "common", "offsets", "start"
std::string ToString(TimelineClock clock);

struct TimelineOptions {
  std::string reference;       ///< empty: the sync file's, else the first camera
  double max_residual_ms = 0;  ///< an instant farther from a frame than this has none; 0: half a frame of that camera
  double jitter_limit = 0.25;  ///< frame periods; time stamps off their clock's line by more (RMS) are taken as they are
};

/// `count` frames are missing after frame `after`.
struct DroppedFrames {
  int64_t after = 0;
  int64_t count = 0;
};

struct CameraTimeline {
  std::string name;
  std::string source;
  std::string status = "Ok";  ///< "Ok", "Variable" (no regular clock), "NoTime" (no usable time stamps), "NoOffset"
  int64_t num_frames = 0;
  double fps_hz = 0;         ///< of its clock
  double offset_frames = 0;  ///< at instant 0 it shows its tick `offset_frames`, as in a sync file
  double sigma_frames = 0;
  double rate_ppm = 0;  ///< its period against the reference's (or against its own nominal rate's when those differ)
  double rate_sigma_ppm = 0;
  double jitter_ms = 0;  ///< RMS of time stamps about the clock's line
  std::vector<DroppedFrames> dropped;
  std::vector<int64_t> doubled;    ///< frames with the time stamp or the picture of the one before: not used
  std::vector<int64_t> bad_times;  ///< frames whose time stamp is missing, or contradicts the others'
  std::vector<int64_t> frame_at;   ///< (num_instants) frame number, -1: none
  std::vector<double>
      residual_s;  ///< (num_instants) time of the frame minus that of the instant; NaN: none. Empty when read from a file
  double residual_median_ms = 0, residual_max_ms = 0;  ///< of their absolute values
};

struct Timeline {
  std::string take;
  std::string reference;
  TimelineClock clock = TimelineClock::kStart;
  double fps_hz = 0;   ///< instants a second
  double start_s = 0;  ///< of instant 0 on the reference's clock
  int64_t num_instants = 0;
  std::vector<CameraTimeline> cameras;

  const CameraTimeline* Find(const std::string& camera) const;  ///< nullptr: not there
};

/// The clock of each camera is a line, time = start + period * tick, fitted robustly to its time stamps; the ticks are counted
/// over gaps, so that a dropped frame leaves a tick without frame. Each instant's frame is the one of the nearest tick.
/// Throws UsageError (unknown reference), FormatError (the reference has no usable times). Cameras without usable times or
/// offset are listed with their status and have no frame at any instant. `sync`: offsets, used unless `clock` is kCommon.
Timeline BuildTimeline(const std::vector<CameraTimes>& cameras, TimelineClock clock, const SyncFile* sync,
                       const TimelineOptions& options = {});

/// `mvstudio.timeline/1`, atomically; the same bytes for the same timeline.
void WriteTimeline(const Timeline& timeline, const std::string& path);
/// Throws IoError, FormatError (path, place).
Timeline ReadTimeline(const std::string& path);

/// The instant that each frame number shows, (frame number, instant) ascending by frame; frames used for several instants have
/// several rows.
std::vector<std::pair<int64_t, int64_t>> InstantsOfFrames(const CameraTimeline& camera);

/// (frame number, tick of the camera's own clock) ascending by frame, for the frames that have one: the position where no frame
/// was dropped or doubled. Pictures keep their numbers; so do the frames of a camera without a regular clock.
std::vector<std::pair<int64_t, int64_t>> TicksOfFrames(const CameraTimes& camera);

/// Offsets of the cameras from their times on a common clock, as a sync file: frame numbers count ticks of each clock from its
/// first frame. Cameras of another rate than the reference's are "OtherRate", those without times "NoTime".
SyncFile SyncFromTimeline(const Timeline& timeline);

}  // namespace mvstudio::dataset
