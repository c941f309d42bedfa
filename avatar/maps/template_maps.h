#pragma once

#include <ATen/core/Tensor.h>

#include "avatar/settings/options.h"

/// The posed body template as the networks' further input and as the first guess that their predictions correct.
namespace mvstudio::avatar {

/// Raw template maps of a picture: share of the pixel that the template covers, the part (1..24; 0 where there is no template
/// at all) and u, v in [0, 1] of what is seen there; part, u and v go on outwards from the nearest covered pixel.
inline constexpr int kTemplateMaps = 4;

/// Input channels that a network of these options has for the template: none without the prior.
int NumTemplateChannels(const ModelOptions& options);

/// Raw maps (B, 4, H, W) float32 as network input (B, NumTemplateChannels, H, W): cover, u and v in [-1, 1], each of the 24
/// parts as 0 or 1.
at::Tensor TemplateChannels(const at::Tensor& template_maps);

/// Adds the template's own answer to a network's two outputs, so that a network that says 0 gives the template: the logit of
/// its cover and, for `tna`, its part before all others and its coordinates before tanh. `channels` as of TemplateChannels;
/// outputs as of the Generator for `method`.
void AddTemplate(const std::string& method, const at::Tensor& channels, at::Tensor* first, at::Tensor* second);

}  // namespace mvstudio::avatar
