#include <ATen/Parallel.h>
#include <torch/torch.h>

#include <algorithm>
#include <cmath>

#include "avatar/batch.h"
#include "avatar/sequence.h"
#include "avatar/train_state.h"
#include "core/error.h"
#include "core/parallel.h"

namespace mvstudio::avatar {

void Trainer::State::Prepare(const AvatarPack& source, const RunContext& run) {
  Validate(source);
  Validate(options);
  options.init_steps = InitSteps(options);  // more --steps later must not move the end of the initialisation
  const int multiple = 1 << model.options.downs;
  if (source.size_px % multiple || source.size_px / multiple < 2) {
    throw UsageError("--size " + std::to_string(source.size_px) + " must be a multiple of 2^downs = " +
                     std::to_string(multiple) + " and at least " + std::to_string(2 * multiple));
  }
  if (model.options.inputs != kNumBones && model.options.inputs != 2 * kNumBones) {
    throw UsageError("--inputs must be 18 (depth of each bone of the 19 joints) or 36 (depth and slope)");
  }
  at::set_num_threads(ResolveThreads(run.num_threads));
  pack = source;
  if (tna()) FitLabelsToMasks(pack, ResolveThreads(run.num_threads));
  const at::Device device(options.device);
  model.generator->to(device);
  if (tna()) model.textures = model.textures.detach().to(device).requires_grad_();
  for (const auto& item : model.generator->named_parameters()) network.Add(item.key(), item.value());
  if (tna()) texels.Add("textures", model.textures);
  if (v2v()) PrepareVideo(device);
}

void Trainer::State::PrepareVideo(const at::Device& device) {
  previous_rows = PreviousRows(pack);
  critic =
      Discriminator(model.options.inputs + 3, options.critic_width, options.critic_layers, options.critic_scales, seed + 1);
  critic->to(device);
  for (const auto& item : critic->named_parameters()) critic_weights.Add(item.key(), item.value());
}

double Trainer::State::RateFactor() const {
  const double left = static_cast<double>(total_steps() - model.step),
               window = options.decay_share * static_cast<double>(total_steps());
  return window <= 0 ? 1.0 : std::clamp(left / window, 0.02, 1.0);
}

double Trainer::State::CriticGradients(const StepInput& input, LossTerms* terms) {
  critic_weights.ClearGradients();  // the generator's loss left some
  const at::Tensor loss = DiscriminatorLoss(critic, input.batch, terms->image);
  terms->Keep("discriminator", loss);
  if (!std::isfinite(loss.item<double>())) return std::nan("");
  loss.backward();
  return critic_weights.GradientNorm();
}

bool Trainer::State::Step(const StepInput& input, LossTerms* terms) {
  std::vector<at::Tensor> buffers;
  for (const at::Tensor& buffer : model.generator->buffers()) buffers.push_back(buffer.clone());
  model.generator->train();
  network.ClearGradients(), texels.ClearGradients();
  *terms = ComputeLoss(model, options, input, InInit(), Context());
  double norm = std::nan(""), texel_norm = 0, critic_norm = 0;
  if (std::isfinite(terms->total().item<double>())) {
    terms->total().backward();
    norm = network.GradientNorm(), texel_norm = texels.GradientNorm();
    if (v2v()) critic_norm = CriticGradients(input, terms);
  }
  torch::NoGradGuard no_grad;
  if (!std::isfinite(norm) || !std::isfinite(texel_norm) || !std::isfinite(critic_norm)) {
    const std::vector<at::Tensor> now = model.generator->buffers();
    for (size_t i = 0; i < now.size(); ++i) at::Tensor(now[i]).copy_(buffers[i]);
    return false;
  }
  if (options.clip_norm > 0 && norm > options.clip_norm) network.ScaleGradients(options.clip_norm / norm);
  network.Step(options.learning_rate * RateFactor());
  if (!InInit()) texels.Step(options.texture_learning_rate * RateFactor());
  if (v2v()) critic_weights.Step(options.learning_rate * RateFactor());
  ++model.step;
  return true;
}

HistoryRow Trainer::State::ScoreHeldOut(const AvatarPack& validation) {
  torch::NoGradGuard no_grad;
  model.generator->eval();
  RowMean mean;
  const std::vector<int64_t> previous = v2v() ? PreviousRows(validation) : std::vector<int64_t>();
  for (const int64_t row : SpreadRows(validation.size(), options.validate_pictures))
    mean.Add(ComputeLoss(model, options, MakeInput(validation, previous, {row}, false, 0), InInit(), Context()));
  return mean.Take(model.step, "validation");
}

}  // namespace mvstudio::avatar
