#include "bench/gpu/learner.h"

#include <torch/torch.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "avatar/train/batch.h"

namespace mvstudio::avatar {
namespace {

/// Colours as smooth as a person's: gradients by coordinates jump at every texel of noise, and no two roundings would agree.
at::Tensor SmoothTextures(int64_t size) {
  const at::Tensor coarse = at::rand({24, 3, 6, 6}) * 1.6 - 0.8;
  return at::upsample_bicubic2d(coarse, {size, size}, /*align_corners=*/false);
}

/// A model whose heads and textures say something, on the CPU.
AvatarModel ModelWithSubstance(const Net& net) {
  at::manual_seed(2);
  AvatarModel model = MakeModel(net.options, net.size_px, {-0.5, 0.5}, 1);
  const at::NoGradGuard no_gradients;
  for (at::Tensor& weight : model.generator->parameters()) {
    const at::Tensor noise = 0.02 * at::randn(weight.sizes());
    if (weight.count_nonzero().item<int64_t>() == 0) weight.copy_(noise);
  }
  if (model.textures.defined()) model.textures.copy_(SmoothTextures(model.textures.size(2)));
  if (model.learned.defined()) model.learned.normal_(0, 0.3);
  return model;
}

at::Tensor Leaf(const at::Tensor& x, const at::Device& device, at::ScalarType type) {
  return x.detach().to(device, type).clone().requires_grad_(x.requires_grad());
}

std::vector<int64_t> FirstRows(int64_t count) {
  std::vector<int64_t> rows(static_cast<size_t>(count));
  std::iota(rows.begin(), rows.end(), 0);
  return rows;
}

/// What v2v sees of the past: other images of the batch.
void AddPast(StepInput* input) {
  const at::Tensor& image = input->batch.image;
  const at::Tensor past = image.flip(0).roll(2, 3);
  input->previous = at::cat({past, past.roll(2, 2)}, 1);
  input->previous_truth = past;
  input->has_previous = at::ones({image.size(0)}, image.options());
}

void AddAll(torch::nn::Module& module, Adam* adam) {
  for (const auto& item : module.named_parameters()) adam->Add(item.key(), item.value());
}

double Length(const Group& group) {
  double squares = 0;
  for (const auto& [key, tensor] : group) squares += tensor.square().sum().item<double>();
  return std::sqrt(squares);
}

double Larger(double worst, double next) {
  return std::isfinite(next) ? std::max(worst, next) : std::numeric_limits<double>::infinity();
}

}  // namespace

double WorstTensor(const Groups& a, const Groups& b) {
  double worst = 0;
  for (const auto& [name, group] : b) {
    const double length = Length(group);
    for (const auto& [key, tensor] : group) {
      const double off = (a.at(name).at(key) - tensor).norm().item<double>();
      worst = Larger(worst, off / (tensor.norm().item<double>() + 1e-3 * length));
    }
  }
  return worst;
}

double WorstGroup(const Groups& a, const Groups& b) {
  double worst = 0;
  for (const auto& [name, group] : b) {
    Group off;
    for (const auto& [key, tensor] : group) off[key] = a.at(name).at(key) - tensor;
    worst = Larger(worst, Length(off) / Length(group));
  }
  return worst;
}

Learner::Learner(const Net& net, const AvatarPack& pack, int64_t batch, const at::Device& device, at::ScalarType type)
    : model_(ModelWithSubstance(net)) {
  options_.keep_init = KeepInit({}, net.options);
  input_.batch = MakeBatch(pack, model_, options_, FirstRows(batch), /*jitter=*/true, 1, 1);
  TrainBatch& b = input_.batch;
  for (at::Tensor* t : {&b.maps, &b.image, &b.mask, &b.uv}) *t = t->to(device, type);
  b.part = b.part.to(device);
  model_.generator->to(device, type);
  AddAll(*model_.generator, &adams_["network"]);
  if (model_.textures.defined()) model_.textures = Leaf(model_.textures, device, type);
  if (model_.learned.defined()) model_.learned = Leaf(model_.learned, device, type);
  if (net.options.method == Method::kTna) adams_["textures"].AddSparse("textures", model_.textures);
  if (net.options.method == Method::kHf) adams_["textures"].AddSparse("learned", model_.learned);
  if (!v2v()) return;
  AddPast(&input_);
  critic_ =
      Discriminator(static_cast<int>(b.maps.size(1)) + 3, net.critic_width, options_.critic_layers, options_.critic_scales, 7);
  critic_->to(device, type);
  AddAll(*critic_, &adams_["critic"]);
}

double Learner::ScaledGradients(bool half, double scale) {
  model_.generator->train();
  for (auto& [name, adam] : adams_) adam.ClearGradients();
  LossContext context;
  context.discriminator = v2v() ? &critic_ : nullptr;
  context.half_precision = half;
  const LossTerms terms = ComputeLoss(model_, options_, input_, false, context);
  (half ? terms.total() * scale : terms.total()).backward();
  double loss = terms.total().item<double>();
  if (v2v()) {
    adams_["critic"].ClearGradients();
    const at::Tensor own = DiscriminatorLoss(critic_, input_.batch, terms.image);
    own.backward();
    loss += own.item<double>();
  }
  const at::NoGradGuard no_gradients;
  for (auto& [name, adam] : adams_)
    if (half && name != "critic") adam.ScaleGradients(1 / scale);
  return loss;
}

double Learner::Gradients(bool half) {
  double loss = ScaledGradients(half, loss_scale_);
  while (half && loss_scale_ > 1 && !std::isfinite(adams_["network"].GradientNorm())) {  // as Trainer does
    loss_scale_ /= 2;
    loss = ScaledGradients(half, loss_scale_);
  }
  return loss;
}

void Learner::Move() {
  const at::NoGradGuard no_gradients;
  Adam& network = adams_["network"];
  const double norm = network.GradientNorm();
  if (norm > options_.clip_norm) network.ScaleGradients(options_.clip_norm / norm);
  for (auto& [name, adam] : adams_) adam.Step(name == "textures" ? options_.texture_learning_rate : options_.learning_rate);
}

Groups Learner::Copies(bool gradients) const {
  Groups groups;
  for (const auto& [name, adam] : adams_) {
    for (const Adam::Slot& slot : adam.slots) {
      const at::Tensor gradient = slot.value.grad();
      const at::Tensor what = !gradients           ? slot.value.detach()
                              : gradient.defined() ? gradient
                                                   : at::zeros_like(slot.value.detach());
      groups[name][slot.name] = what.to(at::kCPU, at::kDouble).clone();
    }
  }
  return groups;
}

Groups Learner::GradientsNow() const { return Copies(true); }
Groups Learner::WeightsNow() const { return Copies(false); }

int64_t Learner::parameters() const {
  int64_t count = 0;
  for (const at::Tensor& weight : model_.generator->parameters()) count += weight.numel();
  return count;
}

}  // namespace mvstudio::avatar
