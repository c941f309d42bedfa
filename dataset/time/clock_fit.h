#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dataset/time/timeline.h"

/// The clock behind one camera's time stamps; not part of the module's public face.
namespace mvstudio::dataset::internal {

constexpr int64_t kNoTick = INT64_MIN;

struct ClockFit {
  std::string status = "Ok";  ///< "Ok", "Variable", "NoTime"
  double period_s = 0;        ///< 0: a single frame
  double start_s = 0;         ///< of tick 0, the first frame with a good time stamp
  double jitter_s = 0;        ///< RMS about the line
  double worst_s = 0;         ///< 99 % of the time stamps are nearer to it than this
  double period_sigma_s = 0, start_sigma_s = 0;
  std::vector<int64_t> tick;  ///< of each frame; kNoTick: it cannot be told, or the frame before has it
  std::vector<size_t> bad;    ///< positions with a time stamp that is missing or contradicts the others
  std::vector<size_t> same;   ///< positions with the tick of the frame before
};

/// Time stamps that fall out of order are found by the longest ascending subsequence; the period first from the median step,
/// then from the line; steps of several periods are gaps. Throws nothing; any input is fine.
ClockFit FitClock(const std::vector<double>& time_s);

}  // namespace mvstudio::dataset::internal
