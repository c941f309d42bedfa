#include "avatar/nets/generator.h"

#include <torch/torch.h>

#include <algorithm>
#include <string>
#include <vector>

#include "avatar/maps/template_maps.h"
#include "avatar/nets/init_weights.h"
#include "avatar/nets/layers.h"
#include "avatar/nets/reference_renderer.h"
#include "core/check.h"

namespace mvstudio::avatar {
namespace {

namespace nn = torch::nn;

void AddNormRelu(const ModelOptions& o, int channels, bool relu, nn::Sequential& out) {
  AddNorm(o, channels, out);
  if (relu) out->push_back(nn::ReLU(nn::ReLUOptions(true)));
}

/// x + norm(conv(relu(norm(conv(x))))).
class ResBlockImpl : public nn::Module {
 public:
  ResBlockImpl(const ModelOptions& o, int channels) {
    nn::Sequential body;
    body->push_back(Conv(channels, channels, 3, 1, false));
    AddNormRelu(o, channels, true, body);
    body->push_back(Conv(channels, channels, 3, 1, false));
    AddNormRelu(o, channels, false, body);
    body_ = register_module("body", body);
  }
  at::Tensor forward(const at::Tensor& x) { return x + body_->forward(x); }

 private:
  nn::Sequential body_{nullptr};
};
TORCH_MODULE(ResBlock);

nn::Sequential MakeStem(const ModelOptions& o) {
  return nn::Sequential(Conv(o.inputs + NumTemplateChannels(o) + NumPreviousChannels(o), o.width, o.stem_kernel, 1, false),
                        nn::ReLU(nn::ReLUOptions(true)));
}

nn::Sequential MakeDown(const ModelOptions& o, int level) {
  nn::Sequential net(Conv(ChannelsAt(o, level), ChannelsAt(o, level + 1), 4, 2, HasBias(o)));
  AddNormRelu(o, ChannelsAt(o, level + 1), true, net);
  return net;
}

nn::Sequential MakeBlocks(const ModelOptions& o, int count) {
  nn::Sequential net;
  for (int i = 0; i < count; ++i) net->push_back(ResBlock(o, ChannelsAt(o, o.downs)));
  return net;
}

/// From level + 1 to level.
nn::Sequential MakeUp(const ModelOptions& o, int level) {
  const int in = ChannelsAt(o, level + 1), out = ChannelsAt(o, level);
  nn::Sequential net;
  if (o.upsample == Upsampling::kTransposed) {
    net->push_back(nn::ConvTranspose2d(nn::ConvTranspose2dOptions(in, out, 4).stride(2).padding(1).bias(HasBias(o))));
  } else {
    net->push_back(nn::Upsample(nn::UpsampleOptions().scale_factor(std::vector<double>{2, 2}).mode(torch::kNearest)));
    net->push_back(Conv(in, out, 3, 1, HasBias(o)));
  }
  AddNormRelu(o, out, true, net);
  return net;
}

/// Residual blocks, then one step up a level, each followed by the encoder's features of that level when there are skips.
class DecoderImpl : public nn::Module {
 public:
  DecoderImpl(const ModelOptions& o, int outputs) : skips_(o.skips) {
    blocks_ = register_module("blocks", MakeBlocks(o, o.decoder_blocks));
    ups_ = register_module("ups", nn::ModuleList());
    for (int level = o.downs - 1; level >= 0; --level) ups_->push_back(MakeUp(o, level));
    head_ = register_module("head", Conv(o.width, outputs, o.head_kernel, 1, false));
  }
  /// `levels`: features of the encoder from full size to the last but one.
  at::Tensor forward(const at::Tensor& code, const std::vector<at::Tensor>& levels) {
    at::Tensor x = blocks_->is_empty() ? code : blocks_->forward(code);
    for (size_t i = 0; i < ups_->size(); ++i) {
      x = ups_[i]->as<nn::Sequential>()->forward(x);
      if (skips_) x = x + levels[ups_->size() - 1 - i];
    }
    return head_->forward(x);
  }
  void BeginAtZero() {
    const torch::NoGradGuard no_gradients;
    head_->weight.zero_();
  }
  bool IsZero() const { return head_->weight.count_nonzero().item<int64_t>() == 0; }
  int64_t outputs() const { return head_->options.out_channels(); }

 private:
  bool skips_;
  nn::Sequential blocks_{nullptr};
  nn::ModuleList ups_{nullptr};
  nn::Conv2d head_{nullptr};
};
TORCH_MODULE(Decoder);

struct Heads {
  const char* first_name;
  int first;
  const char* second_name;
  int second;
};

Heads HeadsOf(const ModelOptions& o) {
  if (o.method == Method::kTna) return {"part_decoder", 25, "uv_decoder", 48};
  if (o.method == Method::kV2v) return {"mask_decoder", 1, "colour_decoder", 6};
  return {"mask_decoder", 1, "colour_decoder", 3};
}

}  // namespace

std::pair<std::string, std::string> DecoderNames(Method method) {
  ModelOptions options;
  options.method = method;
  const Heads heads = HeadsOf(options);
  return {heads.first_name, heads.second_name};
}

int NumBoneChannels(const ModelOptions& options) { return options.method == Method::kHf ? 0 : options.inputs; }

int NumPreviousChannels(const ModelOptions& options) { return options.method == Method::kV2v ? 3 * kNumPrevious : 0; }

struct GeneratorImpl::Parts {
  nn::Sequential stem{nullptr}, blocks{nullptr};
  std::vector<nn::Sequential> downs;
  Decoder first{nullptr}, second{nullptr};
  ReferenceRenderer renderer{nullptr};  // hf alone, in place of all others

  bool IsZero() const { return renderer ? renderer->IsZero() : first->IsZero() && second->IsZero(); }
  int64_t first_outputs() const { return renderer ? 1 : first->outputs(); }
  int64_t second_outputs() const { return renderer ? 3 : second->outputs(); }
};

GeneratorImpl::GeneratorImpl(const ModelOptions& options, uint64_t seed)
    : parts_(std::make_unique<Parts>()), size_multiple_(1 << options.downs) {
  Validate(options);
  if (options.method == Method::kHf) {
    parts_->renderer = register_module("renderer", ReferenceRenderer(options));
    InitWeights(*this, seed);
    parts_->renderer->BeginAtZero();
    return;
  }
  const Heads heads = HeadsOf(options);
  parts_->stem = register_module("stem", MakeStem(options));
  for (int level = 0; level < options.downs; ++level) {
    parts_->downs.push_back(register_module("down" + std::to_string(level), MakeDown(options, level)));
  }
  parts_->blocks = register_module("blocks", MakeBlocks(options, options.encoder_blocks));
  parts_->first = register_module(heads.first_name, Decoder(options, heads.first));
  parts_->second = register_module(heads.second_name, Decoder(options, heads.second));
  InitWeights(*this, seed);
  if (options.prior == Prior::kNone) return;
  parts_->first->BeginAtZero();
  if (options.method == Method::kTna || CorrectsColours(options)) parts_->second->BeginAtZero();
}

GeneratorImpl::~GeneratorImpl() = default;

std::pair<at::Tensor, at::Tensor> GeneratorImpl::forward(const at::Tensor& bone_maps) {
  MVS_CHECK(bone_maps.dim() == 4 && bone_maps.size(2) % size_multiple_ == 0 && bone_maps.size(3) % size_multiple_ == 0,
            "image sizes must be multiples of " << size_multiple_ << ", they are " << bone_maps.sizes());
  MVS_CHECK(std::min(bone_maps.size(2), bone_maps.size(3)) / size_multiple_ >= 2,
            "an image of " << bone_maps.sizes() << " is too small: at least " << 2 * size_multiple_ << " px are needed");
  if (!is_training() && !at::GradMode::is_enabled() && parts_->IsZero()) {
    const auto zeros = [&](int64_t channels) {  // a template that nothing was learned about costs no network
      return at::zeros({bone_maps.size(0), channels, bone_maps.size(2), bone_maps.size(3)}, bone_maps.options());
    };
    return {zeros(parts_->first_outputs()), zeros(parts_->second_outputs())};
  }
  if (parts_->renderer) {
    const at::Tensor out = parts_->renderer->forward(bone_maps);
    return {out.slice(1, 0, 1), out.slice(1, 1)};
  }
  std::vector<at::Tensor> levels;
  at::Tensor x = parts_->stem->forward(bone_maps);
  for (nn::Sequential& down : parts_->downs) {
    levels.push_back(x);
    x = down->forward(x);
  }
  if (!parts_->blocks->is_empty()) x = parts_->blocks->forward(x);
  return {parts_->first->forward(x, levels), parts_->second->forward(x, levels)};
}

int64_t NumParameters(const ModelOptions& options) {
  Generator generator(options, 0);
  int64_t count = 0;
  for (const at::Tensor& weight : generator->parameters()) count += weight.numel();
  return count;
}

}  // namespace mvstudio::avatar
