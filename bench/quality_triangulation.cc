#include "bench/quality.h"

namespace mvstudio::bench {
std::vector<Row> BenchTriangulation(uint64_t) { return {}; }
}  // namespace mvstudio::bench
