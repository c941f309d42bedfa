#pragma once

#include <ATen/core/Tensor.h>

#include "avatar/settings/options.h"

/// The posed body template as additional network input and as the initial value that predictions correct.
namespace mvstudio::avatar {

/// Raw template maps of an image: fraction of the pixel that the template covers, the visible part (1..24; 0 where there
/// is no template at all) and its u, v in [0, 1]. Part, u and v are extended outwards from the nearest covered pixel.
inline constexpr int kTemplateMaps = 4;

/// Opacity of the person in a rendered image: 0 below a probability of 5 %, 1 above 95 %, linear in between.
at::Tensor CleanAlpha(const at::Tensor& mask_prob);

/// Number of input channels for the template with these options; 0 without the prior.
int NumTemplateChannels(const ModelOptions& options);

/// Raw maps (B, 4, H, W) float32 as network input (B, NumTemplateChannels, H, W): cover, u and v in [-1, 1], each of the 24
/// parts as 0 or 1, and `colours` (B, 3, H, W) in [0, 1] where given.
at::Tensor TemplateChannels(const at::Tensor& template_maps, const at::Tensor& colours = {});

/// Adds the template's prediction to a network's two outputs, so that an output of 0 gives the template. `channels` as from
/// TemplateChannels; outputs as from the Generator.
///
/// All methods: the logit of the template's cover. `tna`: the parts share it by their distances in the image, and the second
/// output becomes coordinates in [-1, 1] or a little beyond, the template's plus the tanh of the output; those of a part that
/// is not there are of its nearest pixel (without `spread_parts`: its part before all others, its coordinates before tanh).
/// Where the network corrects colours, the second output's first three channels become the template's plus the tanh of the
/// output.
void AddTemplate(const ModelOptions& options, const at::Tensor& channels, at::Tensor* first, at::Tensor* second);

/// Texture coordinates (B, 48, H, W) by tna's second output, after AddTemplate.
at::Tensor CoordinatesOf(const ModelOptions& options, const at::Tensor& second);

}  // namespace mvstudio::avatar
