#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "stages/nets/render/options.h"
#include "stages/result.h"

namespace mvstudio::stages {

struct AvatarRenderReport {
  InputNotes notes;
  AvatarRenderOptions options;
  std::string dataset;  ///< of the run
  avatar::RenderPlan plan;
  avatar::Method method = avatar::Method::kGaussians;
  int trained_size_px = 0;
  int64_t checkpoint_step = 0;
  double seconds = 0;  ///< of all images
  double rate_hz = 0;
  std::vector<CommandResult::Output> outputs;
};

/// Renders a run's network or Gaussians into images, videos or both. Throws UsageError, IoError and FormatError; images that
/// cannot be made are listed in the plan.
AvatarRenderReport RunAvatarRender(const AvatarRenderOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
