// Private: for evaluate.cc.
#pragma once

#include <ATen/core/Tensor.h>

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "avatar/nets/model.h"
#include "avatar/run/pack/training_set.h"
#include "avatar/run/pack/run_config.h"
#include "avatar/run/references/references.h"
#include "avatar/splats/files/cloud_file.h"
#include "core/progress.h"

namespace mvstudio::avatar {

/// The avatar that is scored: a network, or Gaussians on the fitted body.
struct Subject {
  std::optional<AvatarModel> network;
  std::shared_ptr<const References> references;  ///< of a network that takes some
  std::optional<splats::CloudFile> gaussians;
  std::map<std::string, std::string> training;  ///< as in Evaluation
  int64_t step = 0, num_parameters = 0;

  bool HasMemory() const;
};

/// Of a run that OpenRun accepts.
Subject ReadSubject(const std::string& run_folder, const RunConfig& config);

struct RenderedRows {
  at::Tensor images, masks;  // (N, 3, H, W) 8-bit levels, (N, H, W) float64
};

/// All rows of a pack. A network runs at the size of its training, and its images are scaled to the pack's; Gaussians are
/// rendered at the pack's size.
RenderedRows RenderRows(Subject& subject, const RunConfig& config, const TrainingSet& rows, int batch, const RunContext& run);

}  // namespace mvstudio::avatar
