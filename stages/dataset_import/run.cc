#include "stages/dataset_import/run.h"

#include <chrono>

namespace mvstudio::stages {

DatasetImportReport RunDatasetImport(const DatasetImportOptions& options, const RunContext& run) {
  const auto start = std::chrono::steady_clock::now();
  DatasetImportReport report{options, dataset::ImportPanoptic(options.folder, options.out, options.how, run)};
  report.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace mvstudio::stages
