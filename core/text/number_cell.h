#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace mvstudio {

/// What a cell of a table says, read whole: `0,5` and `12 px` are no numbers.
struct NumberCell {
  enum class Kind { kNumber, kMissing, kOther };
  Kind kind = Kind::kOther;
  double value = 0;  ///< NaN unless kNumber
};

/// Blanks around it are left out. Missing: an empty cell, and the words that numpy, pandas, R and MATLAB write where they have
/// no finite number, in any case: nan, na, n/a, #n/a, <na>, null, none, nil, inf, infinity, the last two with a sign. What
/// goes beyond the range of doubles is kOther.
NumberCell ReadNumberCell(std::string_view text);

/// A whole number in [0, most], also when written as 12.0; nothing for other texts.
std::optional<int> WholeNumberCell(std::string_view text, int most = 999'999'999);

}  // namespace mvstudio
