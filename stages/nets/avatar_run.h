#pragma once

#include <string>
#include <vector>

#include "avatar/run/pack/run_config.h"
#include "avatar/train/train.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// A training run on disk: config.json, checkpoint.safetensors, history.csv, textures.png, samples/step_NNNNNN.png.
class AvatarRun {
 public:
  explicit AvatarRun(const std::string& folder) : folder_(folder) {}

  std::string Path(const std::string& name) const { return folder_ + "/" + name; }
  std::string checkpoint_path() const { return Path(avatar::kCheckpointFile); }
  /// Files of a run, scores included; only these are ever replaced or removed.
  static std::vector<std::string> Names();
  /// Throws UsageError when a run exists and `overwrite` is off.
  void RequireFree(bool overwrite) const;
  /// Creates the folder, without the files of an older run.
  void Clear() const;
  /// Removes scores, because they belong to weights that are about to change.
  void ForgetScores() const;
  /// Reads the rows up to `step` of an older history, to continue from there; returns the seconds it took.
  double ContinueHistory(int64_t step);

  void AddRow(const avatar::HistoryRow& row, double wall_s);
  /// Checkpoint, history, texture preview and sample images, each file atomically.
  void Save(avatar::Trainer& trainer, const avatar::AvatarPack& sample_pack) const;
  /// samples/step_NNNNNN.png: truth, rendering, error and network input of the middle image of the pack.
  void SaveImage(avatar::Trainer& trainer, const avatar::AvatarPack& pack) const;
  /// Files written so far.
  std::vector<CommandResult::Output> Outputs() const;

 private:
  std::string StepPath(const std::string& folder, int64_t step) const;

  std::string folder_;
  std::vector<std::string> rows_;
};

}  // namespace mvstudio::stages
