#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/session/session.h"
#include "dataset/time/timeline.h"

namespace mvstudio::dataset {

/// Numbers and times of a camera's frames. Videos: the presentation times (read, not decoded); images: number / fps after
/// time step 0. Throws like OpenFrames.
CameraTimes ReadFootageTimes(const std::string& camera, const std::string& path, double image_fps_hz);

/// Sets the cameras' times from a table of time stamps (CSV with a header). Columns:
///   camera: `camera`, `cam`, `cam_id`, `camera_id` or `port`, with its name, its serial or the number in its name
///   time: `time`, `timestamp` or `frame_time`, or one of them ending in `_s`, `_ms`, `_us` or `_ns`. Without an ending: the
///     unit that fits the videos' frame rate; else seconds where frames are no more than 10 s apart, or a finer unit that
///     makes 1 to 1000 frames a second
///   frame, optional: `frame`, `frame_index` or `frame_idx`. Without it, a camera's rows are its frames in order of
///     time. The same holds where it numbers as many frames but does not begin at the footage's first.
///
/// Rows of other cameras are skipped. Returns the assumptions made, one line each. Throws FormatError (path, line):
/// missing columns, invalid numbers, a camera without rows, more or fewer rows than frames.
std::vector<std::string> ReadTimestamps(const std::string& path, const std::vector<SessionCamera>& cameras,
                                        std::vector<CameraTimes>* times);

/// Finds frames that repeat the previous image while the scene moves. The largest change of a reduced image is less than
/// an eighth of the median of its neighbours', and that median is at least 6 grey levels. Undetectable in a static scene.
/// Decodes all frames.
std::vector<int64_t> FindRepeats(const std::string& path);

struct TakeTimelineOptions {
  TimelineOptions timeline;
  bool find_repeats = false;
  bool time_codes = false;  ///< by the videos' time codes, whatever else is known; UsageError unless all have one
  bool allow_outside = false;
};

struct TakeTimeline {
  Timeline timeline;
  std::vector<std::string> notes;  ///< assumptions of the timeline, and conflicts: one line each
};

/// Puts all cameras on the clock of their time codes. False, and nothing changes, unless all have one and film at one time
/// by them.
bool PlaceByTimeCodes(std::vector<CameraTimes>* times);

/// Timeline of a take, from time stamps on a common clock if the session names a table, else from the offsets of the
/// take's sync file, else from the time codes of the videos (good to a frame; a note says so). Otherwise the first frames of
/// all cameras are taken as simultaneous (a note says so).
TakeTimeline BuildTakeTimeline(const Session& session, const SessionTake& take, const TakeTimelineOptions& options,
                               const RunContext& run = {});

/// The sync file that a take names, or sync/TAKE/sync.json if it exists; empty: none.
std::string SyncPathOf(const Session& session, const SessionTake& take, bool allow_outside = false);

}  // namespace mvstudio::dataset
