#include "avatar/train.h"

#include <ATen/Parallel.h>
#include <torch/torch.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "avatar/adam.h"
#include "avatar/batch.h"
#include "avatar/sequence.h"
#include "avatar/texture.h"
#include "core/check.h"
#include "core/error.h"
#include "core/parallel.h"

namespace mvstudio::avatar {
namespace {

std::string NamesOfBatch(const AvatarPack& pack, const std::vector<int64_t>& pictures) {
  std::string names;
  for (const int64_t i : pictures) names += (names.empty() ? "" : "; ") + PictureName(pack, i);
  return names;
}

/// Evenly spread rows, at most `count`.
std::vector<int64_t> SpreadRows(int64_t total, int64_t count) {
  std::vector<int64_t> rows;
  const int64_t wanted = std::min(total, count);
  for (int64_t i = 0; i < wanted; ++i) rows.push_back((2 * i + 1) * total / (2 * wanted));
  return rows;
}

/// Sums of rows between two reports.
class RowMean {
 public:
  void Add(const LossTerms& terms) {
    for (size_t i = 0; i < row_.values.size(); ++i) row_.values[i] += terms.Value(i);
    ++count_;
  }
  HistoryRow Take(int64_t step, const std::string& phase) {
    HistoryRow out = row_;
    for (double& value : out.values) value /= static_cast<double>(std::max<int64_t>(count_, 1));
    out.step = step, out.phase = phase;
    *this = RowMean();
    return out;
  }

 private:
  HistoryRow row_;
  int64_t count_ = 0;
};

uint64_t SeedFrom(const TensorFile& checkpoint, const std::string& path) {
  const auto found = checkpoint.metadata.find("seed");
  uint64_t seed = 0;
  if (found == checkpoint.metadata.end() || !(std::istringstream(found->second) >> seed)) {
    throw FormatError(path, "__metadata__.seed", "is missing: this checkpoint cannot be continued");
  }
  return seed;
}

/// A run goes on with the perceptual net it began with.
void CheckNet(const TensorFile& checkpoint, const std::string& path, const FeatureNet* net) {
  const auto found = checkpoint.metadata.find("perceptual");
  const std::string then = found == checkpoint.metadata.end() ? "none" : found->second, now = net ? net->name() : "none";
  if (then != now)
    throw UsageError(path + ": was trained with the perceptual net '" + then + "', now it is '" + now +
                     "'; give the same --perceptual");
}

/// What the network rendered of the two frames before the batch's, under the same jitter; each begins without a past.
void AddPast(AvatarModel& model, const std::vector<int64_t>& previous, const std::vector<int64_t>& rows,
             const std::function<TrainBatch(const std::vector<int64_t>&)>& batch_of, StepInput* input) {
  const auto step_back = [&](const std::vector<int64_t>& from, std::vector<int64_t>* to) {
    at::Tensor has = at::zeros({static_cast<int64_t>(from.size())}, at::kFloat);
    to->clear();
    for (size_t i = 0; i < from.size(); ++i) {
      const int64_t before = previous[from[i]];
      to->push_back(before < 0 ? from[i] : before);  // any row: its picture is blacked out
      has[static_cast<int64_t>(i)] = before < 0 ? 0 : 1;
    }
    return has.view({-1, 1, 1, 1}).to(input->batch.image.device());
  };
  torch::NoGradGuard no_gradients;
  model.generator->eval();
  std::vector<int64_t> rows1, rows2;
  const at::Tensor has1 = step_back(rows, &rows1), has2 = step_back(rows1, &rows2) * has1;
  const TrainBatch batch1 = batch_of(rows1), batch2 = batch_of(rows2);
  const at::Tensor black = at::zeros_like(batch1.image), background = at::zeros({3}, black.options());
  const auto render = [&](const TrainBatch& batch, const at::Tensor& past) {
    const auto [first, second] = model.generator->forward(at::cat({batch.maps, past}, 1));
    return ComposeImage(model, first, second, background, past).clamp(0, 1);
  };
  const at::Tensor image2 = has2 * render(batch2, at::cat({black, black}, 1));
  const at::Tensor image1 = has1 * render(batch1, at::cat({image2, black}, 1));
  input->previous = at::cat({image1, image2}, 1);
  input->previous_truth = has1 * batch1.image;
  input->has_previous = has1.view({-1});
}

}  // namespace

struct Trainer::State {
  AvatarPack pack;  // labels fitted to the masks
  TrainOptions options;
  AvatarModel model;
  Discriminator critic{nullptr};  // v2v alone
  Adam network, texels, critic_weights;
  std::shared_ptr<const FeatureNet> perceptual;
  std::vector<int64_t> previous_rows;  // v2v alone
  uint64_t seed = 1;
  bool textures_ready = false;

  bool v2v() const { return model.options.method == "v2v"; }
  bool tna() const { return model.options.method == "tna"; }
  int64_t total_steps() const { return int64_t{InitSteps(options)} + options.steps; }
  bool InInit() const { return tna() && model.step < InitSteps(options); }

  void Prepare(const AvatarPack& source, const RunContext& run) {
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

  void PrepareVideo(const at::Device& device) {
    previous_rows = PreviousRows(pack);
    critic =
        Discriminator(model.options.inputs + 3, options.critic_width, options.critic_layers, options.critic_scales, seed + 1);
    critic->to(device);
    for (const auto& item : critic->named_parameters()) critic_weights.Add(item.key(), item.value());
  }

  LossContext Context() { return {perceptual.get(), v2v() ? &critic : nullptr}; }

  StepInput MakeInput(const AvatarPack& source, const std::vector<int64_t>& previous, const std::vector<int64_t>& rows,
                      bool jitter, int64_t step) {
    const auto batch_of = [&](const std::vector<int64_t>& some) {
      return MakeBatch(source, model, options, some, jitter, seed, step);
    };
    StepInput input;
    input.batch = batch_of(rows);
    if (v2v()) AddPast(model, previous, rows, batch_of, &input);
    return input;
  }

  /// Average colours under the network's own part and coordinate predictions.
  void AverageTextures() {
    torch::NoGradGuard no_grad;
    model.generator->eval();
    TextureSums sums = ZeroTextureSums(model.options.texture_px);
    for (const int64_t row : SpreadRows(pack.size(), options.texture_pictures)) {
      const TrainBatch batch = MakeBatch(pack, model, options, {row}, false, seed, 0);
      const auto [logits, raw_uv] = model.generator->forward(batch.maps);
      AddPicture(at::softmax(logits, 1).to(at::kCPU), at::tanh(raw_uv).to(at::kCPU), batch, &sums);
    }
    model.textures.copy_(FillTextures(sums));
    model.seen.copy_(sums.weight);
    textures_ready = true;
  }

  static void AddPicture(const at::Tensor& prob, const at::Tensor& uv, const TrainBatch& batch, TextureSums* sums) {
    const at::Tensor part = prob.slice(1, 1).argmax(1) + 1, channel = (part - 1).unsqueeze(1);
    const at::Tensor u = uv.slice(1, 0, 24).gather(1, channel).flatten(), v = uv.slice(1, 24, 48).gather(1, channel).flatten();
    const at::Tensor pixels = batch.mask.to(at::kCPU).flatten().ge(0.5).nonzero().squeeze(1);
    const at::Tensor colour = batch.image.to(at::kCPU)[0].reshape({3, -1}).t() * 2 - 1;
    const at::Tensor weight = prob.gather(1, part.unsqueeze(1)).flatten();
    AddPixels(*sums, part.flatten().index_select(0, pixels), at::stack({u, v}, 1).index_select(0, pixels),
              colour.index_select(0, pixels), weight.index_select(0, pixels));
  }

  double RateFactor() const {
    const double left = static_cast<double>(total_steps() - model.step),
                 window = options.decay_share * static_cast<double>(total_steps());
    return window <= 0 ? 1.0 : std::clamp(left / window, 0.02, 1.0);
  }

  /// Gradients of the discriminator's own loss; returns their norm, NaN when the loss is not finite.
  double CriticGradients(const StepInput& input, LossTerms* terms) {
    critic_weights.ClearGradients();  // the generator's loss left some
    const at::Tensor loss = DiscriminatorLoss(critic, input.batch, terms->image);
    terms->Keep("discriminator", loss);
    if (!std::isfinite(loss.item<double>())) return std::nan("");
    loss.backward();
    return critic_weights.GradientNorm();
  }

  /// One step. Returns false, with nothing changed, when the loss or a gradient is not finite.
  bool Step(const StepInput& input, LossTerms* terms) {
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

  HistoryRow ScoreHeldOut(const AvatarPack& validation) {
    torch::NoGradGuard no_grad;
    model.generator->eval();
    RowMean mean;
    const std::vector<int64_t> previous = v2v() ? PreviousRows(validation) : std::vector<int64_t>();
    for (const int64_t row : SpreadRows(validation.size(), options.validate_pictures))
      mean.Add(ComputeLoss(model, options, MakeInput(validation, previous, {row}, false, 0), InInit(), Context()));
    return mean.Take(model.step, "validation");
  }

  void LoadCritic(const TensorFile& file, const std::string& path) {
    torch::NoGradGuard no_grad;
    for (Adam::Slot& slot : critic_weights.slots) {
      const auto found = file.tensors.find("critic." + slot.name);
      if (found == file.tensors.end() || found->second.sizes() != slot.value.sizes())
        throw FormatError(path, "critic." + slot.name,
                          "is missing or has the wrong shape: this checkpoint cannot be continued");
      slot.value.copy_(found->second);
    }
  }

  void LoadAdam(Adam& adam, const TensorFile& file, const std::string& prefix, const std::string& path) {
    torch::NoGradGuard no_grad;
    for (Adam::Slot& slot : adam.slots) {
      for (auto& [kind, moment] : {std::pair<const char*, at::Tensor>{".first.", slot.first}, {".second.", slot.second}}) {
        const auto found = file.tensors.find(prefix + kind + slot.name);
        if (found == file.tensors.end() || found->second.sizes() != moment.sizes()) {
          throw FormatError(path, prefix + kind + slot.name,
                            "is missing or has the wrong shape: this checkpoint cannot be continued");
        }
        at::Tensor(moment).copy_(found->second);
      }
    }
    std::istringstream(file.metadata.count(prefix + ".step") ? file.metadata.at(prefix + ".step") : "0") >> adam.step;
  }
};

Trainer::Trainer(const AvatarPack& pack, const ModelOptions& model, const TrainOptions& options, const RunContext& run,
                 std::shared_ptr<const FeatureNet> perceptual)
    : state_(std::make_unique<State>()) {
  Validate(pack);
  state_->perceptual = std::move(perceptual);
  state_->options = options;
  state_->seed = run.seed;
  const at::Tensor depth = BoneDepth(pack.joints_in_cam, pack.joint_valid, model.relative_depth);
  state_->model = MakeModel(model, pack.size_px, ChooseDepthRange(depth, pack.joint_valid), run.seed);
  state_->Prepare(pack, run);
}

Trainer::Trainer(const AvatarPack& pack, const TensorFile& checkpoint, const std::string& path, const TrainOptions& options,
                 const RunContext& run, std::shared_ptr<const FeatureNet> perceptual)
    : state_(std::make_unique<State>()) {
  CheckNet(checkpoint, path, perceptual.get());
  state_->perceptual = std::move(perceptual);
  state_->options = options;
  state_->seed = SeedFrom(checkpoint, path);
  state_->model = ModelFromTensors(checkpoint, path);
  state_->Prepare(pack, run);
  state_->LoadAdam(state_->network, checkpoint, "adam", path);
  if (state_->tna()) state_->LoadAdam(state_->texels, checkpoint, "adam_textures", path);
  if (state_->v2v()) {
    state_->LoadAdam(state_->critic_weights, checkpoint, "adam_critic", path);
    state_->LoadCritic(checkpoint, path);
  }
  state_->textures_ready = checkpoint.metadata.count("textures_ready") && checkpoint.metadata.at("textures_ready") == "1";
}

Trainer::~Trainer() = default;

AvatarModel& Trainer::model() { return state_->model; }

TrainReport Trainer::Run(const AvatarPack* validation, const StepCallback& callback, int64_t until_step) {
  State& s = *state_;
  const int64_t goal = until_step >= 0 ? std::min(until_step, s.total_steps()) : s.total_steps();
  TrainReport report;
  RowMean mean;
  while (s.model.step < goal) {
    if (s.tna() && !s.InInit() && !s.textures_ready) s.AverageTextures();
    const int64_t step = s.model.step;
    const std::string phase = s.InInit() ? "init" : "train";
    const bool last_of_phase = step + 1 == goal || (s.tna() && step + 1 == InitSteps(s.options));
    const StepInput input =
        s.MakeInput(s.pack, s.previous_rows, PicturesOfStep(s.pack.size(), s.options.batch, s.seed, step), true, step);
    LossTerms terms;
    if (!s.Step(input, &terms)) {
      report.status = Status::kNonFiniteInput;
      report.message = "step " + std::to_string(step + 1) + ": the loss or a gradient is not finite (" +
                       NamesOfBatch(s.pack, input.batch.pictures) +
                       "); weights kept as they were; try a smaller --learning-rate";
      return report;
    }
    mean.Add(terms);
    ++report.steps_done;
    const bool due = last_of_phase || (step + 1) % s.options.report_every == 0;
    if (due) report.history.push_back(mean.Take(step + 1, phase));
    const bool go_on = !callback || callback(step + 1, due ? &report.history.back() : nullptr);
    if (validation && !s.InInit() && s.options.validate_pictures > 0 &&
        (step + 1 == goal || (step + 1) % s.options.save_every == 0)) {
      report.history.push_back(s.ScoreHeldOut(*validation));
      if (callback) callback(step + 1, &report.history.back());
    }
    if (!go_on) break;
  }
  return report;
}

TensorFile Trainer::Checkpoint() const {
  const State& s = *state_;
  TensorFile file = ModelToTensors(s.model);
  const auto add = [&file](const Adam& adam, const std::string& prefix) {
    for (const Adam::Slot& slot : adam.slots) {
      file.tensors[prefix + ".first." + slot.name] = slot.first.to(at::kCPU).clone();
      file.tensors[prefix + ".second." + slot.name] = slot.second.to(at::kCPU).clone();
    }
    file.metadata[prefix + ".step"] = std::to_string(adam.step);
  };
  add(s.network, "adam");
  if (s.tna()) add(s.texels, "adam_textures");
  if (s.v2v()) {
    add(s.critic_weights, "adam_critic");
    for (const Adam::Slot& slot : s.critic_weights.slots)
      file.tensors["critic." + slot.name] = slot.value.detach().to(at::kCPU).clone();
  }
  file.metadata["perceptual"] = s.perceptual ? s.perceptual->name() : "none";
  for (const auto& [name, value] : FieldsAsText(s.options)) file.metadata["train." + name] = value;
  file.metadata["seed"] = std::to_string(s.seed);
  file.metadata["textures_ready"] = s.textures_ready ? "1" : "0";
  return file;
}

TrainOptions TrainOptionsFrom(const TensorFile& checkpoint, const std::string& path) {
  TrainOptions options;
  for (const auto& [name, value] : FieldsAsText(options)) {
    const auto found = checkpoint.metadata.find("train." + name);
    if (found == checkpoint.metadata.end()) continue;
    try {
      SetFieldFromText(options, name, found->second);
    } catch (const UsageError& error) {
      throw FormatError(path, "__metadata__.train." + name, error.what());
    }
  }
  return options;
}

TrainReport TrainTna(const AvatarPack& pack, const AvatarPack* validation, const ModelOptions& model,
                     const TrainOptions& options, const RunContext& run, const StepCallback& callback, AvatarModel* result) {
  Trainer trainer(pack, model, options, run);
  ProgressStage stage(run, "training", int64_t{InitSteps(options)} + options.steps);
  const TrainReport report = trainer.Run(validation, [&](int64_t step, const HistoryRow* row) {
    if (!row || row->phase != "validation") stage.Advance(1, row ? row->phase : "");
    return !callback || callback(step, row);
  });
  if (result) *result = trainer.model();
  return report;
}

}  // namespace mvstudio::avatar
