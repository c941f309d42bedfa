#include "bench/quality.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "core/statistics.h"

namespace mvstudio::bench {

Row MakeRow(const std::string& problem, const std::string& method, const std::string& unit, std::vector<double> errors,
            double seconds) {
  Row row{problem, method, unit};
  row.us_per_item = 1e6 * seconds / static_cast<double>(errors.size());
  const auto end = std::remove_if(errors.begin(), errors.end(), [](double e) { return std::isnan(e); });
  row.refused = static_cast<double>(errors.end() - end) / static_cast<double>(errors.size());
  errors.erase(end, errors.end());
  if (errors.empty()) return row;
  row.max_error = *std::max_element(errors.begin(), errors.end());
  row.median_error = UpperMedian(std::move(errors));
  return row;
}

}  // namespace mvstudio::bench

/// bench_quality [SEED] [JSON FILE]
int main(int argc, char** argv) {
  using namespace mvstudio::bench;
  const uint64_t seed = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1;
  std::vector<Row> rows = BenchLens(seed);
  const std::vector<Row> triangulation = BenchTriangulation(seed);
  rows.insert(rows.end(), triangulation.begin(), triangulation.end());
  nlohmann::ordered_json json = {{"seed", seed}, {"rows", nlohmann::ordered_json::array()}};
  std::printf("%-44s %-30s %12s %12s %8s %10s\n", "problem", "method", "median", "max", "refused", "us/item");
  for (const Row& row : rows) {
    std::printf("%-44s %-30s %9.2e %-3s %8.2e %-3s %7.1f%% %10.3f\n", row.problem.c_str(), row.method.c_str(), row.median_error,
                row.unit.c_str(), row.max_error, row.unit.c_str(), 100 * row.refused, row.us_per_item);
    json["rows"].push_back({{"problem", row.problem},
                            {"method", row.method},
                            {"unit", row.unit},
                            {"median_error", row.median_error},
                            {"max_error", row.max_error},
                            {"refused", row.refused},
                            {"us_per_item", row.us_per_item}});
  }
  if (argc > 2) std::ofstream(argv[2]) << json.dump(1) << "\n";
  return 0;
}
