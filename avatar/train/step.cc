#include <ATen/Parallel.h>
#include <torch/torch.h>

#include <algorithm>
#include <cmath>

#include "avatar/maps/template_maps.h"
#include "avatar/nets/sequence.h"
#include "avatar/train/batch.h"
#include "avatar/train/train_state.h"
#include "core/error.h"
#include "core/parallel.h"

namespace mvstudio::avatar {
namespace {

constexpr double kFirstLossScale = 65536;
constexpr int64_t kStepsToDoubleScale = 2000;

void CheckFit(const AvatarPack& pack, const AvatarModel& model) {
  const int multiple = 1 << model.options.downs;
  if (pack.size_px % multiple || pack.size_px / multiple < 2) {
    throw UsageError("option 'size' " + std::to_string(pack.size_px) + " must be a multiple of 2^downs = " +
                     std::to_string(multiple) + " and at least " + std::to_string(2 * multiple));
  }
  const int given = NumBodyJoints(pack.joint_valid.size(1)), needed = NumBodyJoints(LayoutOf(model.options.inputs).num_joints);
  if (given != needed) {
    throw UsageError("option 'inputs' " + std::to_string(model.options.inputs) + " needs bodies of " + std::to_string(needed) +
                     " joints, the pack has " + std::to_string(given));
  }
  const bool has_maps = pack.template_maps.defined(), wants_maps = NumTemplateChannels(model.options) > 0;
  if (has_maps != wants_maps || (has_maps && pack.template_maps.size(3) != pack.size_px)) {
    throw UsageError("option 'prior' " + std::string(ToString(model.options.prior)) + (wants_maps ? " needs" : " takes no") +
                     " template maps of the images' size in the pack");
  }
  const at::Tensor& references = pack.references;
  if (TakesReferences(model.options) && !(references.defined() && references.size(3) == pack.size_px))
    throw UsageError("option 'references' needs warped training images in the pack, of the images' size");
  const at::Tensor& colours = pack.template_colours;
  if (CorrectsColours(model.options) && !(colours.defined() && colours.size(3) == pack.size_px)) {
    throw UsageError(
        "option 'template-colours' needs the fitted body's colours in the pack, of the images' size: fit a body (option 'fit' "
        "auto), or leave the option off");
  }
}

}  // namespace

std::string ResolveDevice(const std::string& device) {
  const bool found = torch::cuda::is_available();
  if (device == "auto") return found ? "cuda" : "cpu";
  if (device != "cpu" && !found)
    throw MissingToolError("option 'device' " + device + ": libtorch finds no GPU here; take option 'device' cpu or auto");
  return device;
}

void Trainer::State::Prepare(const AvatarPack& source, const RunContext& run, bool transferred) {
  Validate(source);
  Validate(options);
  options.init_steps =
      InitSteps(options, model.options, transferred);  // more steps asked for later must not move the end of the initialisation
  CheckFit(source, model);
  asked_device = options.device;
  options.device = ResolveDevice(options.device);
  if (options.amp && options.device == "cpu")
    throw UsageError(
        "option 'amp' needs a GPU: half precision is slower than single on CPUs; leave it out or take option 'device' cuda");
  loss_scale = options.amp ? kFirstLossScale : 1;
  initialised = options.init_steps > 0 || NumTemplateChannels(model.options) > 0 || transferred;
  at::set_num_threads(ResolveThreads(run.num_threads));
  pack = source;
  if (tna()) FitLabelsToMasks(pack, ResolveThreads(run.num_threads));
  const at::Device device(options.device);
  model.generator->to(device);
  if (tna()) model.textures = model.textures.detach().to(device).requires_grad_();
  if (hf()) {
    model.textures = model.textures.to(device);
    model.learned = model.learned.detach().to(device).requires_grad_();
  }
  for (const auto& item : model.generator->named_parameters()) network.Add(item.key(), item.value());
  if (tna()) texels.AddSparse("textures", model.textures);
  if (hf()) texels.AddSparse("neural_textures", model.learned);
  if (v2v()) PrepareVideo(device);
}

void Trainer::State::PrepareVideo(const at::Device& device) {
  previous_rows = PreviousRows(pack);
  critic = Discriminator(model.options.inputs + NumTemplateChannels(model.options) + 3, options.critic_width,
                         options.critic_layers, options.critic_scales, seed + 1);
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
  const bool finite = std::isfinite(loss.item<double>());
  if (finite) loss.backward();
  const at::NoGradGuard no_gradients;
  if (!(ranks ? ShareGradients({&critic_weights}, finite) : finite)) return std::nan("");
  return critic_weights.GradientNorm();
}

double Trainer::State::Gradients(const StepInput& input, LossTerms* terms) {
  network.ClearGradients(), texels.ClearGradients();
  *terms = ComputeLoss(model, options, input, InInit(), Context());
  const bool finite = std::isfinite(terms->total().item<double>());
  if (finite) (options.amp ? terms->total() * loss_scale : terms->total()).backward();
  torch::NoGradGuard no_grad;
  if (!(ranks ? ShareGradients({&network, &texels}, finite) : finite)) return std::nan("");
  if (options.amp) network.ScaleGradients(1 / loss_scale), texels.ScaleGradients(1 / loss_scale);
  FreezeUnseen();
  return std::isfinite(texels.GradientNorm()) ? network.GradientNorm() : std::nan("");
}

void Trainer::State::FreezeUnseen() {
  if (!options.freeze_unseen || !tna() || !initialised || !model.textures.grad().defined()) return;
  const at::Tensor seen = (model.seen > 0).unsqueeze(1).to(model.textures.options());
  model.textures.mutable_grad().mul_(seen);
}

bool Trainer::State::Step(const StepInput& input, LossTerms* terms) {
  std::vector<at::Tensor> buffers;
  for (const at::Tensor& buffer : model.generator->buffers()) buffers.push_back(buffer.clone());
  model.generator->train();
  double norm = Gradients(input, terms);
  while (options.amp && !std::isfinite(norm) && loss_scale > 1) {  // too large for half precision: the same step again
    loss_scale /= 2, steps_since_scale = 0;
    norm = Gradients(input, terms);
  }
  const double critic_norm = v2v() && std::isfinite(norm) ? CriticGradients(input, terms) : 0;
  torch::NoGradGuard no_grad;
  if (!std::isfinite(norm) || !std::isfinite(critic_norm)) {
    const std::vector<at::Tensor> now = model.generator->buffers();
    for (size_t i = 0; i < now.size(); ++i) at::Tensor(now[i]).copy_(buffers[i]);
    return false;
  }
  if (options.clip_norm > 0 && norm > options.clip_norm) network.ScaleGradients(options.clip_norm / norm);
  network.Step(options.learning_rate * RateFactor());
  if (!InInit()) texels.Step(options.texture_learning_rate * RateFactor());
  if (v2v()) critic_weights.Step(options.learning_rate * RateFactor());
  ++model.step;
  if (options.amp && ++steps_since_scale >= kStepsToDoubleScale) loss_scale *= 2, steps_since_scale = 0;
  UpdateAverage();
  return true;
}

HistoryRow Trainer::State::ScoreHeldOut(const AvatarPack& validation) {
  torch::NoGradGuard no_grad;
  const BorrowedWeights borrowed(Tensors(), average);
  model.generator->eval();
  RowMean mean;
  const std::vector<int64_t> previous = v2v() ? PreviousRows(validation) : std::vector<int64_t>();
  for (const int64_t row : SpreadRows(validation.size(), options.validate_images))
    mean.Add(ComputeLoss(model, options, MakeInput(validation, previous, {row}, false, 0), InInit(), Context()));
  return mean.Take(model.step, "validation");
}

}  // namespace mvstudio::avatar
