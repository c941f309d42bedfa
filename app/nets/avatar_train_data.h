#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/result.h"
#include "avatar/io/pack/run_config.h"
#include "avatar/settings/options.h"
#include "core/progress.h"

/// Selects the images of a dataset for training and for scoring.
namespace mvstudio::app {

/// As given on the command line; a split file replaces the first three.
struct SplitArguments {
  std::string train_cameras, holdout_cameras, holdout_frames, split, validate_camera;
};

/// Throws UsageError for cameras and frames that do not exist or contradict each other, FormatError for the file.
avatar::DatasetSplit SplitOf(const dataset::PanopticDataset& data, int person, const SplitArguments& arguments);

struct RunPacks {
  avatar::AvatarPack train;
  std::optional<avatar::AvatarPack> watched;  ///< scored at each checkpoint: validation images, else held-out ones, if any
  std::vector<std::string> skipped;
};

/// Sets crop and template shape in `config` from the training images.
RunPacks BuildPacks(const dataset::PanopticDataset& data, const avatar::ModelOptions& model,
                    const avatar::TrainOptions& options, const RunContext& run, avatar::RunConfig* config);

}  // namespace mvstudio::app
