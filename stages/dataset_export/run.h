#pragma once

#include "core/progress.h"
#include "dataset/exports/export.h"
#include "dataset/footage/mask_io.h"
#include "stages/dataset_export/options.h"

namespace mvstudio::stages {

struct DatasetExportReport {
  DatasetExportOptions options;  ///< with `out` by its one name
  bool one_file = false;         ///< options.out is a file
  dataset::MaskMeaning masks;    ///< how they were read; nothing where none was written
  exports::ExportReport written;
};

/// Writes options.out, completely or not at all. Throws UsageError, and what exports::ExportDataset throws; frames without
/// images and joints are no error (ExportReport::images, people).
DatasetExportReport RunDatasetExport(DatasetExportOptions options, const RunContext& run = {});

}  // namespace mvstudio::stages
