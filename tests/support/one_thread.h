#pragma once

#include "core/progress.h"

namespace mvstudio::testing {

inline RunContext OneThread(uint64_t seed = RunContext().seed) {
  RunContext run;
  run.num_threads = 1, run.seed = seed;
  return run;
}

}  // namespace mvstudio::testing
