#include <torch/torch.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string_view>

#include "avatar/train/train_state.h"
#include "core/error.h"
#include "core/format.h"

/// Which weights a training hands out: the last ones, their running average, or those of the best check.
namespace mvstudio::avatar {
namespace {

/// Zero heads give the template (AddTemplate).
bool IsHead(const std::string& name) {
  constexpr std::string_view kEnd = ".head.weight";
  return name.size() > kEnd.size() && name.compare(name.size() - kEnd.size(), kEnd.size(), kEnd) == 0;
}

bool HeadsAreZero(const NamedTensors& tensors) {
  return std::all_of(tensors.begin(), tensors.end(), [](const auto& named) {
    return !IsHead(named.first) || named.second.count_nonzero().template item<int64_t>() == 0;
  });
}

/// What the validation is judged by: the image and the silhouette, not the terms that only steer the training.
double ScoreOf(const HistoryRow& row, const TrainOptions& o) {
  return o.weight_l1 * row["l1"] + o.weight_ssim * row["ssim"] + o.weight_gradient * row["gradient"] +
         o.weight_perceptual * row["perceptual"] + o.weight_mask * row["mask"];
}

void CopyInto(const NamedTensors& from, const NamedTensors& model) {
  torch::NoGradGuard no_grad;
  for (const auto& [name, value] : from) at::Tensor(model.at(name)).copy_(value);
}

template <class T>
T Number(const TensorFile& file, const std::string& key, T otherwise) {
  const auto found = file.metadata.find(key);
  if (found != file.metadata.end()) std::istringstream(found->second) >> otherwise;
  return otherwise;
}

/// Tensors of the file whose name begins with `prefix`, those that fit `model` by name and shape.
NamedTensors WithPrefix(const TensorFile& file, const std::string& prefix, const NamedTensors& model, const std::string& path) {
  NamedTensors found;
  for (const auto& [name, tensor] : file.tensors) {
    if (name.rfind(prefix, 0) != 0) continue;
    const auto own = model.find(name.substr(prefix.size()));
    if (own == model.end() || own->second.sizes() != tensor.sizes() || own->second.scalar_type() != tensor.scalar_type())
      throw FormatError(path, name, "does not fit the network: this checkpoint cannot be continued");
    found[own->first] = tensor.to(own->second.device()).clone();
  }
  return found;
}

}  // namespace

NamedTensors Trainer::State::Tensors() const {
  NamedTensors tensors;
  for (const auto& item : model.generator->named_parameters()) tensors["generator." + item.key()] = item.value();
  for (const auto& item : model.generator->named_buffers()) tensors["generator." + item.key()] = item.value();
  if (model.textures.defined()) tensors["textures"] = model.textures;
  if (model.learned.defined()) tensors["neural_textures"] = model.learned;
  return tensors;
}

void Trainer::State::UpdateAverage() {
  if (options.ema <= 0) return;
  const auto n = static_cast<double>(model.step);
  const double stays = std::min(options.ema, (1 + n) / (10 + n));
  const auto follow = [&](const std::string& name, const at::Tensor& value) {
    at::Tensor& mean = average[name];
    if (!mean.defined()) {
      mean = value.detach().clone();
    } else {
      mean.lerp_(value.detach(), 1 - stays);
    }
  };
  for (const Adam::Slot& slot : network.slots) follow("generator." + slot.name, slot.value);
  if (tna() && textures_ready) follow("textures", model.textures);
  if (hf()) follow("neural_textures", model.learned);
}

bool Trainer::State::CheckDue() const {
  return !InInit() && options.validate_images > 0 && (model.step == total_steps() || model.step % options.save_every == 0);
}

std::string Trainer::State::WhyEndedEarly() const {
  return "ended at step " + std::to_string(model.step) + " of " + std::to_string(total_steps()) + ": " +
         std::to_string(idle_checks) + " checks without a better score on the validation images; " +
         (best.empty() ? "no check had a finite one" : "the weights of step " + std::to_string(best_step) + " are kept");
}

NamedTensors Trainer::State::Handed() const {
  if (!NetworkIsOff()) return best.empty() ? average : best;
  NamedTensors off;
  for (const auto& [name, value] : Tensors()) {
    if (IsHead(name)) off[name] = at::zeros_like(value.detach());
  }
  if (start_textures.defined()) off["textures"] = start_textures;
  return off;
}

void Trainer::State::ScoreStart(const AvatarPack& validation) {
  if (options.least_gain <= 0 || options.validate_images == 0 || model.step > 0 || InInit() || !HeadsAreZero(Tensors())) return;
  if (tna() && !textures_ready) AverageTextures();
  if (tna()) start_textures = model.textures.detach().clone();
  start_ssim = ScoreOnFirstRank(validation)["ssim"];
}

bool Trainer::State::NetworkIsOff() const {
  const bool over = model.step == total_steps() || Exhausted();
  return over && Gain() < options.least_gain;  // false for NaN
}

void Trainer::State::Judge(const HistoryRow& row) {
  if (options.patience <= 0) {
    last_ssim = row["ssim"];
    return;
  }
  const double score = std::isfinite(row["total"]) ? ScoreOf(row, options) : std::nan("");
  if (!std::isfinite(score) || (!best.empty() && !(score < best_score))) {
    ++idle_checks;
    return;
  }
  torch::NoGradGuard no_grad;
  const BorrowedWeights borrowed(Tensors(), average);
  for (const auto& [name, value] : Tensors()) best[name] = value.detach().clone();
  best_score = score, best_step = model.step, idle_checks = 0, last_ssim = row["ssim"];
}

void Trainer::State::SaveHanded(TensorFile* file) const {
  for (const auto& [name, value] : Handed()) {
    file->tensors["live." + name] = file->tensors.at(name);
    file->tensors[name] = value.to(at::kCPU).clone();
  }
  file->metadata["idle_checks"] = std::to_string(idle_checks);
  if (std::isfinite(Gain()))
    file->metadata["start_ssim"] = Format("%.17g", start_ssim), file->metadata["last_ssim"] = Format("%.17g", last_ssim);
  if (start_textures.defined()) file->tensors["start.textures"] = start_textures.to(at::kCPU).clone();
  file->metadata["network_off"] = NetworkIsOff() ? "1" : "0";
  if (best.empty() || NetworkIsOff()) return;
  for (const auto& [name, value] : average) file->tensors["average." + name] = value.to(at::kCPU).clone();
  file->metadata["best_step"] = std::to_string(best_step);
  file->metadata["best_score"] = Format("%.17g", best_score);
}

void Trainer::State::RestoreGivenWeights(const TensorFile& file, const std::string& path) {
  const NamedTensors model_tensors = Tensors(), live = WithPrefix(file, "live.", model_tensors, path);
  start_ssim = Number<double>(file, "start_ssim", std::nan("")), last_ssim = Number<double>(file, "last_ssim", std::nan(""));
  if (const auto start = file.tensors.find("start.textures"); start != file.tensors.end())
    start_textures = start->second.to(model.textures.device());
  if (Number<int>(file, "network_off", 0) == 1) {  // averages and the best check begin anew
    CopyInto(live, model_tensors);
    return;
  }
  NamedTensors handed;
  for (const auto& [name, value] : live) handed[name] = model_tensors.at(name).detach().clone();
  best_step = Number<int64_t>(file, "best_step", -1);
  idle_checks = Number<int64_t>(file, "idle_checks", 0);
  if (best_step >= 0) {
    average = WithPrefix(file, "average.", model_tensors, path);
    if (options.patience > 0) best = handed;
    best_score = Number<double>(file, "best_score", 0);
  } else {
    average = handed;
  }
  if (options.patience <= 0) best_step = -1;
  if (options.ema <= 0) average.clear();
  CopyInto(live, model_tensors);
}

BorrowedWeights::BorrowedWeights(const NamedTensors& model, const NamedTensors& values) {
  for (const auto& [name, value] : values) model_[name] = model.at(name), saved_[name] = model.at(name).detach().clone();
  CopyInto(values, model);
}

BorrowedWeights::~BorrowedWeights() { CopyInto(saved_, model_); }

void Trainer::UseHanded(const std::function<void(AvatarModel&)>& use) {
  const BorrowedWeights borrowed(state_->Tensors(), state_->Handed());
  use(state_->model);
}

}  // namespace mvstudio::avatar
