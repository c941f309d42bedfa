#pragma once

#include <cstdint>
#include <functional>

namespace mvstudio {

/// Number of threads to use when `requested` is 0; otherwise `requested`.
int ResolveThreads(int requested);

/// Calls `body(i)` for i in [0, count) on `num_threads` threads, including this one, or on fewer if the system provides no
/// more. Each i is called once and must write only its own result, so that the outcome does not depend on the number of
/// threads. The first exception is rethrown here after all threads have stopped.
void ParallelFor(int64_t count, int num_threads, const std::function<void(int64_t)>& body);

}  // namespace mvstudio
