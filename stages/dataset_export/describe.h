#pragma once

#include "stages/dataset_export/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// What was written, and what of the dataset is not in it.
CommandResult Describe(const DatasetExportReport& report);

}  // namespace mvstudio::stages
