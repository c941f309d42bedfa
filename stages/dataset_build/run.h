#pragma once

#include <string>
#include <vector>

#include "core/notice.h"
#include "core/progress.h"
#include "dataset/build/build.h"
#include "stages/dataset_build/options.h"
#include "stages/input_notes.h"
#include "stages/part.h"

namespace mvstudio::stages {

struct DatasetBuildReport {
  DatasetBuildOptions options;  ///< as the session settled them
  InputNotes notes;
  dataset::BuildInputs inputs;
  dataset::BuildReport built;
  std::string calibrated_world;  ///< axes of the calibration's world, in words
  double wall_s = 0;

  /// The joints state another world than the calibration: they may be of an earlier one.
  bool OtherWorld() const;
  /// Some camera has no image, or no mask, of a time step with joints.
  bool IsPartial() const;
};

/// Builds the folder options.out. Throws UsageError, IoError and FormatError, and what dataset::BuildDataset throws; a take
/// without any image of the joints' time steps is no error (BuildReport::images).
DatasetBuildReport RunDatasetBuild(DatasetBuildOptions options, const RunContext& run = {});

/// Keeps `options.part` where RunDatasetBuild with the same options finds it. Throws as that does.
PartReport RunDatasetBuildPart(DatasetBuildOptions options, const RunContext& run = {});

}  // namespace mvstudio::stages
