#include "avatar/nets/reference_renderer.h"

#include <torch/torch.h>

#include <string>
#include <vector>

#include "avatar/nets/layers.h"

namespace mvstudio::avatar {
namespace {

namespace nn = torch::nn;

constexpr int kOutputs = 4;

int NumBodyChannels(const ModelOptions& o) { return o.neural_channels + 4; }

/// From level to level + 1, halving the size.
nn::Sequential MakeDown(const ModelOptions& o, int in, int level) {
  const int out = ChannelsAt(o, level);
  nn::Sequential net(Conv(in, out, 4, 2, HasBias(o)));
  AddNorm(o, out, net);
  net->push_back(nn::LeakyReLU(nn::LeakyReLUOptions().negative_slope(0.2).inplace(true)));
  return net;
}

nn::Sequential MakeUp(const ModelOptions& o, int in, int out) {
  nn::Sequential net(Conv(in, out, 3, 1, HasBias(o)));
  AddNorm(o, out, net);
  net->push_back(nn::ReLU(nn::ReLUOptions(true)));
  return net;
}

at::Tensor Twice(const at::Tensor& x) {
  return at::upsample_bilinear2d(x, {2 * x.size(2), 2 * x.size(3)}, /*align_corners=*/false);
}

/// Features of each level, the largest first.
std::vector<at::Tensor> Encode(std::vector<nn::Sequential>& downs, at::Tensor x) {
  std::vector<at::Tensor> levels;
  for (nn::Sequential& down : downs) levels.push_back(x = down->forward(x));
  return levels;
}

}  // namespace

int NumRendererChannels(const ModelOptions& options) {
  return NumBodyChannels(options) + (TakesReferences(options) ? kReferenceMaps : 0);
}

struct ReferenceRendererImpl::Parts {
  ModelOptions options;
  std::vector<nn::Sequential> downs, reference_downs, ups;
  nn::Sequential last{nullptr};  // with skips: at the full size, before the head
  nn::Conv2d head{nullptr};

  bool references() const { return !reference_downs.empty(); }
  /// Whether level l's features go around the smaller ones.
  bool SkipsBody(int l) const { return options.skips || l > 0; }
  bool SkipsReferences() const { return options.skips && references(); }
  int ChannelsInto(int level) const;
};

/// Input channels of the step that enlarges level `level`.
int ReferenceRendererImpl::Parts::ChannelsInto(int level) const {
  const int own = ChannelsAt(options, level), smallest = options.downs - 1;
  if (level == smallest) return references() ? 2 * own : own;
  const int from_below = ChannelsAt(options, level + 1);
  return from_below + (SkipsBody(level) ? own : 0) + (SkipsReferences() ? own : 0);
}

ReferenceRendererImpl::ReferenceRendererImpl(const ModelOptions& options) : parts_(std::make_unique<Parts>()) {
  Parts& p = *parts_;
  p.options = options;
  for (int l = 0; l < options.downs; ++l) {
    const std::string name = std::to_string(l);
    const int below = l > 0 ? ChannelsAt(options, l - 1) : 0;
    p.downs.push_back(register_module("down" + name, MakeDown(options, l > 0 ? below : NumBodyChannels(options), l)));
    if (TakesReferences(options))
      p.reference_downs.push_back(
          register_module("reference_down" + name, MakeDown(options, l > 0 ? below : kReferenceMaps, l)));
  }
  for (int l = options.downs - 1; l > 0; --l)
    p.ups.push_back(register_module("up" + std::to_string(l), MakeUp(options, p.ChannelsInto(l), ChannelsAt(options, l))));
  int into_head = p.ChannelsInto(0);
  if (options.skips) {
    p.last = register_module(
        "last", nn::Sequential(Conv(into_head + NumRendererChannels(options), options.width, 3, 1, true), nn::ReLU()));
    into_head = options.width;
  }
  p.head = register_module("head", Conv(into_head, kOutputs, options.head_kernel, 1, false));
}

ReferenceRendererImpl::~ReferenceRendererImpl() = default;

at::Tensor ReferenceRendererImpl::forward(const at::Tensor& input) {
  Parts& p = *parts_;
  const int64_t body = NumBodyChannels(p.options);
  const std::vector<at::Tensor> levels = Encode(p.downs, input.slice(1, 0, body));
  std::vector<at::Tensor> seen;
  if (p.references()) seen = Encode(p.reference_downs, input.slice(1, body, body + kReferenceMaps));
  at::Tensor x = levels.back();
  if (p.references()) x = at::cat({x, seen.back()}, 1);
  for (int l = p.options.downs - 2; l >= 0; --l) {
    std::vector<at::Tensor> joined;
    joined.reserve(3);
    joined.push_back(p.ups[p.options.downs - 2 - l]->forward(Twice(x)));
    if (p.SkipsBody(l)) joined.push_back(levels[l]);
    if (p.SkipsReferences()) joined.push_back(seen[l]);
    x = at::cat(joined, 1);
  }
  x = Twice(x);
  if (p.options.skips) x = p.last->forward(at::cat({x, input}, 1));
  return p.head->forward(x);
}

void ReferenceRendererImpl::BeginAtZero() {
  const torch::NoGradGuard no_gradients;
  parts_->head->weight.zero_();
}

bool ReferenceRendererImpl::IsZero() const { return parts_->head->weight.count_nonzero().item<int64_t>() == 0; }

}  // namespace mvstudio::avatar
