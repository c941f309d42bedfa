#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dataset/panoptic/panoptic_files.h"

/// Capture times of the frames of a Panoptic sequence, on the studio's universal clock ("univTime", ms). HD cameras run at
/// 29.97 Hz, VGA cameras at 25 Hz and each Kinect by itself: only this clock relates them.
namespace mvstudio::dataset {

/// Frame times of cameras on one clock.
struct PanopticClock {
  std::map<int, double> known_ms;       ///< frame -> univTime
  double origin_ms = 0, period_ms = 0;  ///< least-squares line through them
  double worst_ms = 0;                  ///< largest distance of a known time from the line
  bool is_line = false;                 ///< at least two, all within a quarter of a period of the line

  /// The known time, else that of the line, else empty.
  std::optional<double> TimeMs(int frame) const;
  /// The frame nearest to a time; empty when that is farther than a period.
  std::optional<int> NearestFrame(double time_ms) const;
};
PanopticClock FitPanopticClock(std::map<int, double> known_ms);

/// Relation between the frame numbers of joints and the positions in a sync table: frame f has time univ_time[f + shift].
/// CMU's own scripts use shift 1 (they call it a weird offset). Here it is estimated from the times where there are
/// joints.
struct PanopticTableMatch {
  int shift = 1;
  int compared = 0;        ///< frames with both times; 0: `shift` is CMU's default
  double residual_ms = 0;  ///< median difference at this shift
  /// The times disagree at every shift by more than a millisecond.
  bool contradicts() const { return compared > 0 && residual_ms > 1; }
};
PanopticTableMatch MatchPanopticTable(const std::map<int, double>& known_ms, const PanopticSyncTrack& track);

/// Adds the table's times for frames without a time.
void AddTable(const PanopticSyncTrack& track, const PanopticTableMatch& match, std::map<int, double>* known_ms);

/// Times of a Kinect's colour images by the number in their names, which begins at 1: 6.25 ms before the table's.
std::map<int, double> KinectColorTimesMs(const PanopticSyncTables& tables, int node);

}  // namespace mvstudio::dataset
