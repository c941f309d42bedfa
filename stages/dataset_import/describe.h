#pragma once

#include "stages/dataset_import/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// What was left out makes it partial; frames with joints of nobody are an error.
CommandResult Describe(const DatasetImportReport& report);

}  // namespace mvstudio::stages
