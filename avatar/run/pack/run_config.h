#pragma once

#include <string>
#include <vector>

#include "avatar/run/pack/body_shape.h"
#include "avatar/run/pack/training_set.h"

namespace mvstudio::avatar {

/// The inputs of a training run: RUN/config.json. Evaluation needs only this and the checkpoint beside it.
struct RunConfig {
  std::string dataset;      ///< absolute folder, Panoptic layout
  TrainingSetOptions pack;  ///< size, crop and person; its cameras and frames are those used for training
  DatasetSplit split;
  BodyShape shape;           ///< as fitted on the training images
  double half_extent_m = 0;  ///< metres from the middle of a crop to its edge, at the person
  std::string body_file;     ///< the fitted body: body.npz beside the configuration; empty: the template with `shape`
  double template_iou = 0;   ///< mean IoU of the posed template and the masks of the training images
};

inline constexpr char kRunConfigSchema[] = "mvstudio.avatar-run/1";
inline constexpr char kRunConfigFile[] = "config.json";
inline constexpr char kCheckpointFile[] = "checkpoint.safetensors";
inline constexpr char kGaussiansFile[] = "gaussians.npz";            ///< in its place where Gaussians were trained
inline constexpr char kReferencesFile[] = "references.safetensors";  ///< training images that method `hf` warps

void WriteRunConfig(const RunConfig& config, const std::string& path);
/// Throws IoError / FormatError with the place.
RunConfig ReadRunConfig(const std::string& path);
/// Whether the run of a folder is of Gaussians.
bool HoldsGaussians(const std::string& folder);
/// Throws IoError that says how to go on where a run's checkpoint is missing.
void RequireCheckpoint(const std::string& path);
/// The configuration of a run that has a checkpoint, or Gaussians, and whose dataset exists (pack.keep_views where
/// rendering needs them); `dataset`, unless empty, replaces the one used for training. Throws IoError / FormatError naming what
/// is missing.
RunConfig OpenRun(const std::string& folder, const std::string& dataset);

}  // namespace mvstudio::avatar
