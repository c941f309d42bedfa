#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dataset/panoptic/panoptic_files.h"

/// When the frames of a Panoptic sequence were taken, on the studio's universal clock ("univTime", ms). HD cameras run at 29.97
/// Hz, VGA cameras at 25 Hz and each Kinect by itself: only this clock relates them.
namespace mvstudio::dataset {

/// Times of the frames of cameras that run together.
struct PanopticClock {
  std::map<int, double> known_ms;       ///< frame -> univTime
  double origin_ms = 0, period_ms = 0;  ///< the line through them, by least squares
  double worst_ms = 0;                  ///< largest distance of a known time from the line
  bool is_line = false;                 ///< at least two, all within a quarter of a period of the line

  /// The known time, else that of the line, else nothing.
  std::optional<double> TimeMs(int frame) const;
  /// The frame nearest to a time; nothing when that is farther than a period.
  std::optional<int> NearestFrame(double time_ms) const;
};
PanopticClock FitPanopticClock(std::map<int, double> known_ms);

/// How the frame numbers of joints relate to the positions in a sync table: frame f has time univ_time[f + shift]. CMU's own
/// scripts use shift 1 (they call it a weird offset); found here by the times themselves where there are joints.
struct PanopticTableMatch {
  int shift = 1;
  int compared = 0;        ///< frames with both times; 0: `shift` is only CMU's habit
  double residual_ms = 0;  ///< median difference at this shift
  /// The two disagree at every shift by more than a millisecond.
  bool contradicts() const { return compared > 0 && residual_ms > 1; }
};
PanopticTableMatch MatchPanopticTable(const std::map<int, double>& known_ms, const PanopticSyncTrack& track);

/// Adds the table's times of frames that have none.
void AddTable(const PanopticSyncTrack& track, const PanopticTableMatch& match, std::map<int, double>* known_ms);

/// Times of a Kinect's colour pictures by the number in their names, which begins at 1: 6.25 ms before the table's.
std::map<int, double> KinectColorTimesMs(const PanopticSyncTables& tables, int node);

}  // namespace mvstudio::dataset
