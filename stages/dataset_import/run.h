#pragma once

#include "core/progress.h"
#include "stages/dataset_import/options.h"

namespace mvstudio::stages {

struct DatasetImportReport {
  DatasetImportOptions options;
  dataset::PanopticImportReport imported;
  double wall_s = 0;
};

/// Throws UsageError, IoError, and FormatError when nothing can be imported; what was left out is in the report.
DatasetImportReport RunDatasetImport(const DatasetImportOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
