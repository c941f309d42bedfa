#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/pack/build.h"
#include "stages/dataset_pack/options.h"

namespace mvstudio::stages {

/// Joints of a dataset's own skeleton that are none of Panoptic's 19, which are all that a pack holds.
struct LostJoints {
  std::string folder;  ///< where the dataset keeps them
  std::string skeleton;
  std::vector<std::string> names;
  size_t of = 0;  ///< joints of the skeleton

  std::string Text() const;
};

struct DatasetPackReport {
  DatasetPackOptions options;
  std::optional<LostJoints> lost;
  dataset::PackBuildReport built;
  bool wrote_single = false;
};

/// Makes or merges the pack options.out. Throws UsageError, IoError and FormatError, also where most joints of the dataset
/// would be lost; shards that others are making are no error (PackBuildReport::busy).
DatasetPackReport RunDatasetPack(DatasetPackOptions options, const RunContext& run = {});

}  // namespace mvstudio::stages
