#pragma once

#include "stages/dataset_build/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// The dataset in a few lines, metrics of its cameras and masks, and what is wrong with it.
CommandResult Describe(const DatasetBuildReport& report);

}  // namespace mvstudio::stages
