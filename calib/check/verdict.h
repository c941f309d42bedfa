#pragma once

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include "core/notice.h"

namespace mvstudio::calib {

enum class Outcome { kPass, kWarn, kFail };

/// "pass", "warn", "fail".
inline std::string_view ToString(Outcome outcome) {
  return outcome == Outcome::kPass ? "pass" : outcome == Outcome::kWarn ? "warn" : "fail";
}

/// Judgement of a calibration, with the figures that decided it.
struct Verdict {
  std::vector<Notice> reasons;  ///< empty for a pass; one that fails makes the verdict fail

  void Warn(Notice reason) { Add(false, std::move(reason)); }
  void Fail(Notice reason) { Add(true, std::move(reason)); }
  void Add(bool fails, Notice reason) {
    reason.fails = fails;
    reasons.push_back(std::move(reason));
  }
  Outcome outcome() const {
    if (std::any_of(reasons.begin(), reasons.end(), [](const Notice& reason) { return reason.fails; })) return Outcome::kFail;
    return reasons.empty() ? Outcome::kPass : Outcome::kWarn;
  }
};

}  // namespace mvstudio::calib
