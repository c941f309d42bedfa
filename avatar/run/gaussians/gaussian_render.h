#pragma once

#include <functional>

#include "avatar/run/render/render.h"
#include "avatar/splats/files/cloud_file.h"

namespace mvstudio::avatar {

/// As RenderImages, of Gaussians on the run's fitted body: each image is rendered at its own size. Throws UsageError where
/// `network-size` is asked for.
void RenderGaussianImages(const splats::CloudFile& file, const RunConfig& config, const RenderPlan& plan,
                          const RenderOptions& options, const RunContext& run,
                          const std::function<void(const RenderJob&, const Image&)>& on_image);

}  // namespace mvstudio::avatar
