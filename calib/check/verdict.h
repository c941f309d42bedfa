#pragma once

#include <string>
#include <vector>

#include "core/notice.h"

namespace mvstudio::calib {

/// Judgement of a calibration, with the figures that decided it.
struct Verdict {
  std::string status = "pass";  ///< pass, warn or fail
  std::vector<Notice> reasons;  ///< empty for pass; one that fails makes the verdict `fail` alone
};

}  // namespace mvstudio::calib
