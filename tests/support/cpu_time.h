#pragma once

#include <ctime>

namespace mvstudio::testing {

/// What this process has computed, s: bounds on it hold on a machine that does other things, too.
inline double CpuSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

}  // namespace mvstudio::testing
