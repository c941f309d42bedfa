#pragma once

#include <chrono>

namespace mvstudio {

/// Measures from its construction, by a clock that is never set.
class Stopwatch {
 public:
  double Seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace mvstudio
