#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dataset/time/timeline.h"

/// The clock behind one camera's time stamps; internal to the module.
namespace mvstudio::dataset::internal {

constexpr int64_t kNoTick = INT64_MIN;

struct ClockFit {
  ClockStatus status = ClockStatus::kOk;  ///< kOk, kVariable or kNoTime
  double period_s = 0;                    ///< 0: a single frame
  double start_s = 0;                     ///< of tick 0, the first frame with a good time stamp
  double jitter_s = 0;                    ///< RMS about the line
  double worst_s = 0;                     ///< 99 % of the time stamps are within this distance of it
  double period_sigma_s = 0, start_sigma_s = 0;
  std::vector<int64_t> tick;  ///< of each frame; kNoTick: undetermined, or already that of the previous frame
  std::vector<size_t> bad;    ///< positions with a missing time stamp, or one that contradicts the others
  std::vector<size_t> same;   ///< positions with the tick of the previous frame
};

/// Fits a clock to time stamps. Stamps out of order are found by the longest ascending subsequence. The period comes first
/// from the median step, then from the line; steps of several periods are gaps. Throws nothing for any input.
ClockFit FitClock(const std::vector<double>& time_s);

}  // namespace mvstudio::dataset::internal
