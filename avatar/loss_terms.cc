#include "avatar/loss_terms.h"

#include <ATen/ATen.h>

#include <cmath>

#include "avatar/losses.h"
#include "core/check.h"

namespace mvstudio::avatar {
namespace {

struct Outputs {
  at::Tensor first, second;
};

Outputs Forward(AvatarModel& model, const StepInput& input) {
  const at::Tensor maps = input.previous.defined() ? at::cat({input.batch.maps, input.previous}, 1) : input.batch.maps;
  const auto [first, second] = model.generator->forward(maps);
  return {first, second};
}

at::Tensor Picture(const AvatarModel& model, const StepInput& input, const Outputs& out) {
  return ComposeImage(model, out.first, out.second, at::zeros({3}, input.batch.image.options()), input.previous);
}

void AddPictureTerms(const TrainOptions& o, const StepInput& input, const at::Tensor& image, const LossContext& context,
                     LossTerms* terms) {
  const TrainBatch& batch = input.batch;
  terms->Add("l1", o.weight_l1, WeightedL1(image, batch.image, batch.mask, o.foreground_weight));
  if (o.weight_ssim > 0) terms->Add("ssim", o.weight_ssim, SsimLoss(image, batch.image, batch.mask, o.foreground_weight));
  if (o.weight_gradient > 0) terms->Add("gradient", o.weight_gradient, GradientLoss(image, batch.image));
  if (o.weight_perceptual > 0 && context.perceptual)
    terms->Add("perceptual", o.weight_perceptual, PerceptualLoss(*context.perceptual, image, batch.image));
}

/// Video-to-video: patches that look real, activations of the discriminator, and a flow that carries the truth of the frame
/// before to this one.
void AddVideoTerms(const TrainOptions& o, const StepInput& input, const at::Tensor& image, const at::Tensor& second,
                   const LossContext& context, LossTerms* terms) {
  const TrainBatch& batch = input.batch;
  if (context.discriminator && (o.weight_gan > 0 || o.weight_features > 0)) {
    const PatchFeatures fake = (*context.discriminator)->forward(at::cat({batch.maps, image}, 1));
    PatchFeatures real;
    {
      const at::NoGradGuard no_gradients;
      real = (*context.discriminator)->forward(at::cat({batch.maps, batch.image}, 1));
    }
    terms->Add("gan", o.weight_gan, PatchLoss(fake, true));
    terms->Add("features", o.weight_features, FeatureMatching(fake, real));
  }
  if (o.weight_warp > 0) {
    const at::Tensor error = (Warp(input.previous_truth, FlowOf(second)) - batch.image).abs().mean(1) * batch.mask;
    const at::Tensor weight = input.has_previous.view({-1, 1, 1}) * batch.mask;
    terms->Add("warp", o.weight_warp, (error * weight).sum() / weight.sum().clamp_min(1));
  }
}

}  // namespace

size_t LossColumn(std::string_view name) {
  for (size_t i = 0; i < kLossColumns.size(); ++i) {
    if (name == kLossColumns[i]) return i;
  }
  MVS_CHECK(false, "no loss term is called " << name);
  return 0;
}

void LossTerms::Add(std::string_view name, double weight, const at::Tensor& value) {
  Keep(name, value);
  total_ = total_.defined() ? total_ + weight * value : weight * value;
  values_[0] = total_.detach();
}

void LossTerms::Keep(std::string_view name, const at::Tensor& value) { values_[LossColumn(name)] = value.detach(); }

void LossTerms::SetNotFinite(const at::Tensor& like) { values_[0] = total_ = at::full({}, std::nan(""), like.options()); }

double LossTerms::Value(size_t column) const { return values_[column].defined() ? values_[column].item<double>() : 0; }

LossTerms ComputeLoss(AvatarModel& model, const TrainOptions& o, const StepInput& input, bool init,
                      const LossContext& context) {
  const TrainBatch& batch = input.batch;
  const Outputs out = Forward(model, input);
  LossTerms terms;
  if (!std::isfinite((out.first.detach().sum() + out.second.detach().sum()).item<double>())) {
    terms.SetNotFinite(out.first);
    return terms;
  }
  terms.Add("mask", o.weight_mask, MaskLoss(out.first, batch.mask));
  const bool tna = model.options.method == "tna";
  const double share = init ? 1.0 : o.keep_init;
  if (tna && share > 0) {
    terms.Add("part", share * o.weight_part, PartLoss(out.first, batch.part));
    terms.Add("uv", share * o.weight_uv, UvLoss(at::tanh(out.second), batch.uv, batch.part));
  }
  if (o.weight_logit > 0) {
    const at::Tensor colours = model.options.method == "v2v" ? out.second.slice(1, 0, 3) : out.second;
    terms.Add("logit", o.weight_logit, SaturationLoss(colours, 4) + SaturationLoss(out.first, 20));
  }
  if (init) return terms;
  const at::Tensor image = Picture(model, input, out);
  terms.image = image.detach();
  AddPictureTerms(o, input, image, context, &terms);
  if (model.options.method == "v2v") AddVideoTerms(o, input, image, out.second, context, &terms);
  return terms;
}

at::Tensor DiscriminatorLoss(Discriminator& discriminator, const TrainBatch& batch, const at::Tensor& image) {
  return 0.5 * (PatchLoss(discriminator->forward(at::cat({batch.maps, batch.image}, 1)), true) +
                PatchLoss(discriminator->forward(at::cat({batch.maps, image}, 1)), false));
}

}  // namespace mvstudio::avatar
