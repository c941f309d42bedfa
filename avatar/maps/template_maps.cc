#include "avatar/maps/template_maps.h"

#include <ATen/ATen.h>

#include "core/check.h"

namespace mvstudio::avatar {
namespace {

constexpr int64_t kParts = 24;
constexpr int64_t kFirstPart = 3;  // channels before the parts: cover, u, v

// Neither so sure that gradients vanish, nor so unsure that the picture is hazy: both ends lie beyond CleanAlpha's 5 and 95 %.
constexpr double kSureLogit = 4, kOtherPartLogit = -8;
constexpr double kLargestCoordinate = 0.98;  // atanh grows without bound at the chart's edge

}  // namespace

int NumTemplateChannels(const ModelOptions& options) {
  return options.prior == Prior::kTemplate ? static_cast<int>(kFirstPart + kParts) : 0;
}

at::Tensor TemplateChannels(const at::Tensor& template_maps) {
  MVS_CHECK(template_maps.dim() == 4 && template_maps.size(1) == kTemplateMaps,
            "template maps must be (B, 4, H, W), they are " << template_maps.sizes());
  const at::Tensor part = template_maps.slice(1, 1, 2);
  const at::Tensor numbers = at::arange(1, kParts + 1, part.options()).view({1, kParts, 1, 1});
  const at::Tensor uv = (template_maps.slice(1, 2, 4) * 2 - 1) * (part > 0);
  return at::cat({template_maps.slice(1, 0, 1), uv, (part == numbers).to(at::kFloat)}, 1);
}

void AddTemplate(Method method, const at::Tensor& channels, at::Tensor* first, at::Tensor* second) {
  const at::Tensor person = at::logit(channels.slice(1, 0, 1), 1e-6).clamp(-kSureLogit, kSureLogit);
  if (method != Method::kTna) {
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
