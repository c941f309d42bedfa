#pragma once

#include <sstream>

#include "core/error.h"

/// Throws ContractViolation with file, line, condition and `message` (a stream expression) unless `condition` holds.
#define MVS_CHECK(condition, message)                                                   \
  do {                                                                                  \
    if (!(condition)) {                                                                 \
      std::ostringstream mvs_check_text;                                                \
      mvs_check_text << __FILE__ << ":" << __LINE__ << ": " #condition ": " << message; \
      throw ::mvstudio::ContractViolation(mvs_check_text.str());                        \
    }                                                                                   \
  } while (false)
