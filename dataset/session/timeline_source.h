#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/session/session.h"
#include "dataset/time/timeline.h"

namespace mvstudio::dataset {

/// Numbers and times of a camera's frames: the presentation times of a video (read, not decoded); pictures are number / fps
/// after instant 0. Throws like OpenFrames.
CameraTimes ReadFootageTimes(const std::string& camera, const std::string& path, double picture_fps_hz);

/// Gives the cameras the times of a table of time stamps (CSV with a header). Columns: a camera (`camera`, `cam`, `cam_id`,
/// `camera_id`, `port`: its name, its serial or the number in its name), a time (`time`, `timestamp` or `frame_time` in
/// seconds, or one of them ending in `_s`, `_ms`, `_us` or `_ns`) and, optionally, the frame (`frame`, `frame_index`,
/// `frame_idx`; without it, or where it numbers as many frames but does not begin at the footage's first, the rows of a camera
/// are its frames in order of time). Rows of other cameras are skipped. Returns what was taken to be so, one line each. Throws
/// FormatError (path, line): missing columns, numbers, a camera without rows, more or fewer rows than frames.
std::vector<std::string> ReadTimestamps(const std::string& path, const std::vector<SessionCamera>& cameras,
                                        std::vector<CameraTimes>* times);

/// Frames that show the picture of the one before again, while the scene moves: on a reduced picture the largest change is less
/// than an eighth of the median of its neighbours', and that is at least 6 grey levels. A still scene tells nothing. Decodes
/// all.
std::vector<int64_t> FindRepeats(const std::string& path);

struct TakeTimelineOptions {
  TimelineOptions timeline;
  bool find_repeats = false;
  bool allow_outside = false;
};

struct TakeTimeline {
  Timeline timeline;
  std::vector<std::string> notes;  ///< what the timeline rests on, and what is doubtful: one line each
};

/// Of a take: time stamps on a common clock where the session names a table; else the offsets of the take's sync file; else the
/// first frames of all cameras are taken to be one instant (a note says so).
TakeTimeline BuildTakeTimeline(const Session& session, const SessionTake& take, const TakeTimelineOptions& options,
                               const RunContext& run = {});

/// The sync file that a take names, or sync/TAKE/sync.json where it is there; empty: none.
std::string SyncPathOf(const Session& session, const SessionTake& take, bool allow_outside = false);

}  // namespace mvstudio::dataset
