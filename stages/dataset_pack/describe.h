#pragma once

#include "stages/dataset_pack/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Shards, what they cost, and what of the dataset is not in them.
CommandResult Describe(const DatasetPackReport& report);

}  // namespace mvstudio::stages
