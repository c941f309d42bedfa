#include "stages/dataset_import/run.h"

#include "core/stopwatch.h"

namespace mvstudio::stages {

DatasetImportReport RunDatasetImport(const DatasetImportOptions& options, const RunContext& run) {
  const Stopwatch watch;
  DatasetImportReport report{options, dataset::ImportPanoptic(options.folder, options.out, options.how, run)};
  report.wall_s = watch.Seconds();
  return report;
}

}  // namespace mvstudio::stages
