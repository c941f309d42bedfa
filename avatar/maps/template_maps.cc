#include "avatar/maps/template_maps.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "avatar/maps/spread_labels.h"
#include "core/check.h"
#include "core/parallel.h"

namespace mvstudio::avatar {
namespace {

constexpr int64_t kParts = 24;
constexpr int64_t kFirstPart = 3;  // channels before the parts: cover, u, v
constexpr int64_t kFirstColour = kFirstPart + kParts;

// Neither so sure that gradients vanish, nor so unsure that the image is hazy: both ends lie beyond CleanAlpha's 5 and 95 %.
constexpr double kSureLogit = 4, kOtherPartLogit = -8;
constexpr double kLargestCoordinate = 0.98;  // atanh grows without bound at the chart's edge

// Of parts beside the visible one, relative to its logit: a pixel off in an image of 96 px is 2 %, three are never.
constexpr float kOtherPart = -1, kPerImageWidth = -288, kLeastOther = -12;

constexpr double kHaze = 0.05;  // of a person is none in a rendered image, and of background none either

/// Logit of the probability whose CleanAlpha is the cover.
at::Tensor LogitOfAlpha(const at::Tensor& cover) {
  const at::Tensor edge = at::logit(kHaze + (1 - 2 * kHaze) * cover);
  return at::where(cover <= 0, at::full_like(cover, -kSureLogit),
                   at::where(cover >= 1, at::full_like(cover, kSureLogit), edge));
}

/// What the template says of every part at each pixel.
struct PartField {
  at::Tensor shares;  // (B, 24, H, W) logarithm of its likelihood, up to a constant
  at::Tensor uv;      // (B, 48, H, W) in [-1, 1]
};

/// Fills in one image's part k from its pixels `own` (H, W).
void SpreadPart(const at::Tensor& own, int64_t b, int64_t k, const float* uv, PartField* field) {
  const int64_t height = own.size(0), width = own.size(1), area = height * width;
  const std::vector<int64_t> nearest = NearestPixels(height, width, nullptr, own.data_ptr<uint8_t>());
  if (nearest[0] < 0) return;  // the part is nowhere
  float* shares = field->shares.data_ptr<float>() + (b * kParts + k) * area;
  float* out = field->uv.data_ptr<float>() + (b * 2 * kParts + k) * area;
  for (int64_t p = 0; p < area; ++p) {
    const int64_t from = nearest[p];
    const auto distance =
        std::hypot(static_cast<float>(p % width - from % width), static_cast<float>(p / width - from / width));
    const float fall = kOtherPart + kPerImageWidth * distance / static_cast<float>(std::max(width, height));
    shares[p] = from == p ? 0 : std::max(kLeastOther, fall);
    out[p] = uv[from], out[kParts * area + p] = uv[area + from];
  }
}

/// From the template's parts (B, 24, H, W), 0 or 1, and coordinates (B, 2, H, W) of the visible ones.
PartField SpreadParts(const at::Tensor& parts, const at::Tensor& uv) {
  const int64_t batch = parts.size(0), height = parts.size(2), width = parts.size(3);
  const at::Tensor own = parts.to(at::kCPU).gt(0.5f).to(at::kByte).contiguous();
  const at::Tensor coordinates = uv.to(at::kCPU).to(at::kFloat).contiguous();
  PartField field = {at::full({batch, kParts, height, width}, kLeastOther, at::kFloat),
                     at::zeros({batch, 2 * kParts, height, width}, at::kFloat)};
  ParallelFor(batch * kParts, at::get_num_threads(), [&](int64_t i) {
    const int64_t b = i / kParts, k = i % kParts;
    SpreadPart(own[b][k], b, k, coordinates.data_ptr<float>() + b * 2 * height * width, &field);
  });
  return {field.shares.to(parts.device()), field.uv.to(parts.device())};
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
  if (options.spread_parts) {
    const PartField field = SpreadParts(parts, channels.slice(1, 1, kFirstPart));
    *first = *first + at::cat({at::zeros_like(person), person + at::log_softmax(field.shares, 1)}, 1);
    *second = field.uv + at::tanh(*second);
    return;
  }
  const at::Tensor logits = parts * person + (1 - parts) * kOtherPartLogit;
  *first = *first + at::cat({at::zeros_like(person), logits}, 1);
  const at::Tensor uv = at::atanh(channels.slice(1, 1, kFirstPart).clamp(-kLargestCoordinate, kLargestCoordinate));
  *second = *second + at::cat({parts * uv.slice(1, 0, 1), parts * uv.slice(1, 1, 2)}, 1);
}

at::Tensor CoordinatesOf(const ModelOptions& options, const at::Tensor& second) {
  return CorrectsParts(options) ? second : at::tanh(second);
}

}  // namespace mvstudio::avatar
