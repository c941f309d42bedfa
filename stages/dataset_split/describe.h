#pragma once

#include "stages/dataset_split/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// The parts of the split, and how far the test is from the training.
CommandResult Describe(const DatasetSplitReport& report);

}  // namespace mvstudio::stages
