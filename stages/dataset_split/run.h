#pragma once

#include "core/progress.h"
#include "dataset/views/split.h"
#include "stages/dataset_split/options.h"
#include "stages/input_notes.h"

namespace mvstudio::stages {

struct DatasetSplitReport {
  DatasetSplitOptions options;
  InputNotes notes;
  dataset::Split split;
  dataset::SplitReport distance;  ///< of the test from the training
};

/// Makes a split with the seed of `run`, or reads the one to describe; writes it to options.out where that is given. Throws
/// UsageError, IoError and FormatError; a test that is near to the training, or has no joints, is no error.
DatasetSplitReport RunDatasetSplit(DatasetSplitOptions options, const RunContext& run = {});

}  // namespace mvstudio::stages
