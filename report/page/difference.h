#pragma once

#include <optional>
#include <string>

#include "report/page/value.h"

namespace mvstudio::report {

/// The first field in which two trees differ.
struct ValueDifference {
  std::string field;  ///< dotted; "" for the whole
  Value own, other;
};

/// In the order of the fields of `other`, then of those that `own` has alone; nothing where both are equal.
std::optional<ValueDifference> FirstDifference(const Value& own, const Value& other, const std::string& field = "");

}  // namespace mvstudio::report
