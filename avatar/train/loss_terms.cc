#include "avatar/train/loss_terms.h"

#include <ATen/ATen.h>
#include <ATen/autocast_mode.h>
#include <torch/version.h>

#include <cmath>

#include "avatar/maps/template_maps.h"
#include "avatar/train/losses.h"
#include "core/check.h"

namespace mvstudio::avatar {
namespace {

struct Outputs {
  at::Tensor first, second;
};

#if TORCH_VERSION_MAJOR > 2 || (TORCH_VERSION_MAJOR == 2 && TORCH_VERSION_MINOR >= 4)
bool HalfIsOn() { return at::autocast::is_autocast_enabled(at::kCUDA); }
void TurnHalf(bool on) { at::autocast::set_autocast_enabled(at::kCUDA, on); }
#else
bool HalfIsOn() { return at::autocast::is_enabled(); }
void TurnHalf(bool on) { at::autocast::set_enabled(on); }
#endif

/// Half precision on GPUs while it lives.
class Autocast {
 public:
  explicit Autocast(bool on) : before_(HalfIsOn()) { TurnHalf(on); }
  ~Autocast() {
    at::autocast::clear_cache();
    TurnHalf(before_);
  }
  Autocast(const Autocast&) = delete;
  Autocast& operator=(const Autocast&) = delete;

 private:
  bool before_;
};

Outputs Forward(AvatarModel& model, const StepInput& input, bool half_precision) {
  const Autocast autocast(half_precision);
  const auto [first, second] = Predict(model, input.batch.maps, input.previous);
  return {first, second};
}

/// With the template the outline is known from the start, so the image is compared as it will be rendered. Without it a faint
/// person is where the gradient of the outline comes from.
at::Tensor OutputImage(const AvatarModel& model, const StepInput& input, const Outputs& out) {
  const auto compose = model.options.prior == Prior::kTemplate ? CleanImage : ComposeImage;
  return compose(model, out.first, out.second, at::zeros({3}, input.batch.image.options()), input.previous);
}

enum TotalIndex { kImage, kSsim, kPerson, kRest, kMoving };

at::Tensor TotalOf(const StepInput& input, TotalIndex index) {
  return input.totals.defined() ? input.totals[index] : at::Tensor();
}

at::Tensor MovingWeight(const StepInput& input) { return input.has_previous.view({-1, 1, 1}) * input.batch.mask; }

void AddImageTerms(const TrainOptions& o, const StepInput& input, const at::Tensor& image, const LossContext& context,
                   LossTerms* terms) {
  const TrainBatch& batch = input.batch;
  const double foreground = o.foreground_weight;
  terms->Add("l1", o.weight_l1, WeightedL1(image, batch.image, batch.mask, foreground, TotalOf(input, kImage)));
  if (o.weight_ssim > 0)
    terms->Add("ssim", o.weight_ssim, SsimLoss(image, batch.image, batch.mask, foreground, TotalOf(input, kSsim)));
  const at::Tensor weights = PixelWeights(batch.mask, foreground, TotalOf(input, kImage));
  if (o.weight_gradient > 0) terms->Add("gradient", o.weight_gradient, GradientLoss(image, batch.image, weights));
  if (o.weight_perceptual > 0 && context.perceptual)
    terms->Add("perceptual", o.weight_perceptual, PerceptualLoss(*context.perceptual, image, batch.image, weights));
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
    const at::Tensor weight = MovingWeight(input), total = TotalOf(input, kMoving);
    terms->Add("warp", o.weight_warp, (error * weight).sum() / (total.defined() ? total : weight.sum()).clamp_min(1));
  }
}

}  // namespace

at::Tensor LossTotals(const StepInput& input, double foreground_weight) {
  const TrainBatch& batch = input.batch;
  const at::Tensor person = (batch.part > 0).sum().to(at::kFloat);
  const at::Tensor moving = input.has_previous.defined() ? MovingWeight(input).sum() : at::zeros_like(person);
  return at::stack({PixelTotal(batch.mask, foreground_weight), SsimPixelTotal(batch.mask, foreground_weight), person,
                    static_cast<double>(batch.part.numel()) - person, moving});
}

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
  const Outputs out = Forward(model, input, context.half_precision);
  LossTerms terms;
  if (!std::isfinite((out.first.detach().sum() + out.second.detach().sum()).item<double>())) {
    terms.SetNotFinite(out.first);
    return terms;
  }
  terms.Add("mask", o.weight_mask, MaskLoss(out.first, batch.mask));
  const bool tna = model.options.method == Method::kTna;
  const double share = init ? 1.0 : KeepInit(o, model.options);
  if (tna && share > 0) {
    terms.Add("part", share * o.weight_part, PartLoss(out.first, batch.part, TotalOf(input, kPerson), TotalOf(input, kRest)));
    terms.Add("uv", share * o.weight_uv,
              UvLoss(CoordinatesOf(model.options, out.second), batch.uv, batch.part, TotalOf(input, kPerson)));
  }
  if (o.weight_logit > 0) {
    const at::Tensor colours = model.options.method == Method::kV2v ? out.second.slice(1, 0, 3) : out.second;
    terms.Add("logit", o.weight_logit, SaturationLoss(colours, 4) + SaturationLoss(out.first, 20));
  }
  if (init) return terms;
  const at::Tensor image = OutputImage(model, input, out);
  terms.image = image.detach();
  AddImageTerms(o, input, image, context, &terms);
  if (model.options.method == Method::kV2v) AddVideoTerms(o, input, image, out.second, context, &terms);
  return terms;
}

at::Tensor DiscriminatorLoss(Discriminator& discriminator, const TrainBatch& batch, const at::Tensor& image) {
  return 0.5 * (PatchLoss(discriminator->forward(at::cat({batch.maps, batch.image}, 1)), true) +
                PatchLoss(discriminator->forward(at::cat({batch.maps, image}, 1)), false));
}

}  // namespace mvstudio::avatar
