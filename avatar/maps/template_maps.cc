#include "avatar/maps/template_maps.h"

#include <ATen/ATen.h>

#include <vector>

#include "core/check.h"

namespace mvstudio::avatar {
namespace {

constexpr int64_t kParts = 24;
constexpr int64_t kFirstPart = 3;  // channels before the parts: cover, u, v
constexpr int64_t kFirstColour = kFirstPart + kParts;

// Neither so sure that gradients vanish, nor so unsure that the picture is hazy: both ends lie beyond CleanAlpha's 5 and 95 %.
constexpr double kSureLogit = 4, kOtherPartLogit = -8;
constexpr double kLargestCoordinate = 0.98;  // atanh grows without bound at the chart's edge

constexpr double kHaze = 0.05;  // of a person is none in a rendered image, and of background none either

/// Logit of the probability whose CleanAlpha is the cover.
at::Tensor LogitOfAlpha(const at::Tensor& cover) {
  const at::Tensor edge = at::logit(kHaze + (1 - 2 * kHaze) * cover);
  return at::where(cover <= 0, at::full_like(cover, -kSureLogit),
                   at::where(cover >= 1, at::full_like(cover, kSureLogit), edge));
}

/// The first three of the second output's channels.
void AddColours(const at::Tensor& colours, at::Tensor* second) {
  const at::Tensor corrected = colours + at::tanh(second->slice(1, 0, 3));
  *second = at::cat({corrected, second->slice(1, 3)}, 1);
}

}  // namespace

at::Tensor CleanAlpha(const at::Tensor& mask_prob) { return ((mask_prob - kHaze) / (1 - 2 * kHaze)).clamp(0, 1); }

int NumTemplateChannels(const ModelOptions& options) {
  if (options.prior != Prior::kTemplate) return 0;
  return static_cast<int>(kFirstColour + (CorrectsColours(options) ? 3 : 0));
}

at::Tensor TemplateChannels(const at::Tensor& template_maps, const at::Tensor& colours) {
  MVS_CHECK(template_maps.dim() == 4 && template_maps.size(1) == kTemplateMaps,
            "template maps must be (B, 4, H, W), they are " << template_maps.sizes());
  const at::Tensor part = template_maps.slice(1, 1, 2);
  const at::Tensor numbers = at::arange(1, kParts + 1, part.options()).view({1, kParts, 1, 1});
  const at::Tensor uv = (template_maps.slice(1, 2, 4) * 2 - 1) * (part > 0);
  std::vector<at::Tensor> channels = {template_maps.slice(1, 0, 1), uv, (part == numbers).to(at::kFloat)};
  if (colours.defined()) channels.push_back(colours);
  return at::cat(channels, 1);
}

void AddTemplate(const ModelOptions& options, const at::Tensor& channels, at::Tensor* first, at::Tensor* second) {
  const at::Tensor cover = channels.slice(1, 0, 1);
  if (CorrectsColours(options)) {
    *first = *first + LogitOfAlpha(cover);
    AddColours(channels.slice(1, kFirstColour, kFirstColour + 3), second);
    return;
  }
  const at::Tensor person = at::logit(cover, 1e-6).clamp(-kSureLogit, kSureLogit);
  if (options.method != Method::kTna) {
    *first = *first + person;
    return;
  }
  const at::Tensor parts = channels.slice(1, kFirstPart, kFirstPart + kParts);
  const at::Tensor logits = parts * person + (1 - parts) * kOtherPartLogit;
  *first = *first + at::cat({at::zeros_like(person), logits}, 1);
  const at::Tensor uv = at::atanh(channels.slice(1, 1, kFirstPart).clamp(-kLargestCoordinate, kLargestCoordinate));
  *second = *second + at::cat({parts * uv.slice(1, 0, 1), parts * uv.slice(1, 1, 2)}, 1);
}

}  // namespace mvstudio::avatar
