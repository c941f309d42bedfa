#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mvstudio {

/// Whether a column of that name holds the times of the rows.
bool IsTimeColumn(std::string_view name);

/// Frames of rows by their times: frame k is at k steps, the step is that of most rows, gaps stay gaps.
struct RowFrames {
  double step = 0;          ///< in the times' unit
  std::vector<int> frames;  ///< one a row; rows of one time share it
};

/// `times` in the order of the rows, in any unit; `step`: the step where it is known, 0: it is found. Nothing, and `why`, where
/// they do not tell: a row has none, they fall, fewer than three differ and the step is not known, their steps are no multiples
/// of one, or they begin beyond a million frames (a clock of the day).
std::optional<RowFrames> FramesOfTimes(const std::vector<double>& times, std::string* why, double step = 0);

}  // namespace mvstudio
