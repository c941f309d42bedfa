#include <torch/torch.h>

#include <sstream>

#include "avatar/train/train_state.h"
#include "core/error.h"

namespace mvstudio::avatar {
namespace {

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
                     "'; give the same option 'perceptual'");
  const auto digest = checkpoint.metadata.find("perceptual_sha256");  // older checkpoints have none
  if (net && digest != checkpoint.metadata.end() && digest->second != net->sha256())
    throw UsageError(path + ": was trained with another perceptual net of the name '" + then + "', of SHA-256 " +
                     digest->second + "; give that file as option 'perceptual'");
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
  for (Adam::Slot& slot : adam.slots) {
    if (!slot.count.defined()) continue;
    const auto found = file.tensors.find(prefix + ".count." + slot.name);  // older checkpoints have none
    const bool known = found != file.tensors.end() && found->second.sizes() == slot.count.sizes();
    slot.count.copy_(known ? found->second : (slot.second > 0) * static_cast<double>(adam.step));
    const auto steps = static_cast<double>(adam.step);
    if (!slot.count.ge(0).logical_and(slot.count.le(steps)).all().item<bool>())
      throw FormatError(path, prefix + ".count." + slot.name,
                        "counts more steps than were made: this checkpoint cannot be continued");
  }
}

}  // namespace

void Trainer::State::Restore(const TensorFile& file, const std::string& path) {
  LoadAdam(network, file, "adam", path);
  if (!texels.slots.empty()) LoadAdam(texels, file, "adam_textures", path);
  if (v2v()) {
    LoadAdam(critic_weights, file, "adam_critic", path);
    LoadCritic(file, path);
  }
  const auto flag = [&](const char* name, bool otherwise) {
    return file.metadata.count(name) ? file.metadata.at(name) == "1" : otherwise;
  };
  textures_ready = flag("textures_ready", false);
  initialised = flag("initialised", initialised);
  if (options.amp && file.metadata.count("loss_scale")) {
    std::istringstream(file.metadata.at("loss_scale")) >> loss_scale;
    std::istringstream(file.metadata.at("steps_since_scale")) >> steps_since_scale;
  }
  RestoreGivenWeights(file, path);
}

void Trainer::State::LoadCritic(const TensorFile& file, const std::string& path) {
  torch::NoGradGuard no_grad;
  for (Adam::Slot& slot : critic_weights.slots) {
    const auto found = file.tensors.find("critic." + slot.name);
    if (found == file.tensors.end() || found->second.sizes() != slot.value.sizes())
      throw FormatError(path, "critic." + slot.name, "is missing or has the wrong shape: this checkpoint cannot be continued");
    slot.value.copy_(found->second);
  }
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
  state_->Restore(checkpoint, path);
  state_->images_per_step = int64_t{TrainOptionsFrom(checkpoint, path).batch} * RanksFrom(checkpoint, path);
}

TensorFile Trainer::Checkpoint() const {
  const State& s = *state_;
  TensorFile file = ModelToTensors(s.model);
  const auto add = [&file](const Adam& adam, const std::string& prefix) {
    for (const Adam::Slot& slot : adam.slots) {
      file.tensors[prefix + ".first." + slot.name] = slot.first.to(at::kCPU).clone();
      file.tensors[prefix + ".second." + slot.name] = slot.second.to(at::kCPU).clone();
      if (slot.count.defined()) file.tensors[prefix + ".count." + slot.name] = slot.count.to(at::kCPU).clone();
    }
    file.metadata[prefix + ".step"] = std::to_string(adam.step);
  };
  add(s.network, "adam");
  if (!s.texels.slots.empty()) add(s.texels, "adam_textures");
  if (s.v2v()) {
    add(s.critic_weights, "adam_critic");
    for (const Adam::Slot& slot : s.critic_weights.slots)
      file.tensors["critic." + slot.name] = slot.value.detach().to(at::kCPU).clone();
  }
  file.metadata["perceptual"] = s.perceptual ? s.perceptual->name() : "none";
  if (s.perceptual) file.metadata["perceptual_sha256"] = s.perceptual->sha256();
  for (const auto& [name, value] : FieldsAsText(s.options)) file.metadata["train." + name] = value;
  file.metadata["train.device"] = s.asked_device;
  if (s.world() > 1) file.metadata["train.ranks"] = std::to_string(s.world());
  file.metadata["initialised"] = s.initialised ? "1" : "0";
  if (s.options.amp) {
    file.metadata["loss_scale"] = std::to_string(static_cast<int64_t>(s.loss_scale));
    file.metadata["steps_since_scale"] = std::to_string(s.steps_since_scale);
  }
  s.SaveHanded(&file);
  file.metadata["seed"] = std::to_string(s.seed);
  file.metadata["textures_ready"] = s.textures_ready ? "1" : "0";
  return file;
}

int RanksFrom(const TensorFile& checkpoint, const std::string& path) {
  const auto found = checkpoint.metadata.find("train.ranks");
  if (found == checkpoint.metadata.end()) return 1;
  int ranks = 0;
  if (!(std::istringstream(found->second) >> ranks) || ranks < 1)
    throw FormatError(path, "__metadata__.train.ranks", "must be a whole number from 1");
  return ranks;
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

}  // namespace mvstudio::avatar
