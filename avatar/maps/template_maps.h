#pragma once

#include <ATen/core/Tensor.h>

#include "avatar/settings/options.h"

/// The posed body template as additional network input and as the initial value that predictions correct.
namespace mvstudio::avatar {

/// Raw template maps of an image: fraction of the pixel that the template covers, the visible part (1..24; 0 where there
/// is no template at all) and its u, v in [0, 1]. Part, u and v are extended outwards from the nearest covered pixel.
inline constexpr int kTemplateMaps = 4;

/// Number of input channels for the template with these options; 0 without the prior.
int NumTemplateChannels(const ModelOptions& options);

/// Raw maps (B, 4, H, W) float32 as network input (B, NumTemplateChannels, H, W): cover, u and v in [-1, 1], each of the 24
/// parts as 0 or 1.
at::Tensor TemplateChannels(const at::Tensor& template_maps);

/// Adds the template's prediction to a network's two outputs, so that an output of 0 gives the template. Added are the
/// logit of its coverage and, for `tna`, its part before all others and its coordinates before tanh. `channels` as from
/// TemplateChannels; outputs as from the Generator for `method`.
void AddTemplate(Method method, const at::Tensor& channels, at::Tensor* first, at::Tensor* second);

}  // namespace mvstudio::avatar
