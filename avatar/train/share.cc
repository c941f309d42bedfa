#include <torch/torch.h>

#include <array>

#include "avatar/train/batch.h"
#include "avatar/train/train_state.h"
#include "core/check.h"
#include "core/error.h"
#include "core/hash/sha256.h"

/// What several processes that train together tell each other.
namespace mvstudio::avatar {
namespace {

at::Tensor ValuesOf(const HistoryRow& row) {
  return at::tensor(at::ArrayRef<double>(row.values.data(), row.values.size()), at::kDouble);
}

/// What must be the same on all ranks.
constexpr std::array<const char*, 5> kShared = {"pictures", "training options", "network options", "seed", "steps done"};

/// 48 bits of a digest, exact in a double.
double Digest(const std::string& bytes) {
  return static_cast<double>(std::stoull(Sha256Hex(bytes.data(), bytes.size()).substr(0, 12), nullptr, 16));
}

template <class Options>
double DigestOf(const Options& options) {
  std::string text;
  for (const auto& [name, value] : FieldsAsText(options)) {
    if (name != "device") text += name + "=" + value + "\n";
  }
  return Digest(text);
}

double DigestOf(const AvatarPack& pack) {
  std::string bytes;
  const auto add = [&bytes](const at::Tensor& t) {
    bytes.append(static_cast<const char*>(t.contiguous().data_ptr()), t.nbytes());
  };
  for (const at::Tensor& t : {pack.joints_in_cam, pack.joint_valid, pack.intrinsics, pack.camera_idx, pack.frame}) add(t);
  for (const at::Tensor& t : {pack.images, pack.masks}) add(t.flatten(1).sum(1, false, at::kLong));
  return Digest(bytes + std::to_string(pack.size_px));
}

/// A number for each of kShared.
at::Tensor SharedOf(const AvatarPack& pack, const TrainOptions& options, const ModelOptions& model, uint64_t seed,
                    int64_t step) {
  return at::tensor({DigestOf(pack), DigestOf(options), DigestOf(model), static_cast<double>(seed % (uint64_t{1} << 52)),
                     static_cast<double>(step)},
                    at::kDouble);
}

void SetValues(const at::Tensor& values, HistoryRow* row) {
  std::copy_n(values.data_ptr<double>(), row->values.size(), row->values.begin());
}

}  // namespace

std::vector<int64_t> Trainer::State::RowsOfStep(int64_t step, bool all) const {
  const std::vector<int64_t> rows = ImagesOfStep(pack.size(), options.batch * world(), seed, step);
  if (all || !ranks) return rows;
  const auto first = rows.begin() + ranks->rank() * options.batch;
  return {first, first + options.batch};
}

bool Trainer::State::ShareGradients(const std::vector<Adam*>& adams, bool finite) {
  std::vector<at::Tensor> parts;
  for (const Adam* adam : adams) {
    for (const Adam::Slot& slot : adam->slots) {
      const bool has = finite && slot.value.grad().defined();
      parts.push_back(has ? slot.value.grad().flatten().to(at::kCPU) : at::zeros({slot.value.numel()}, at::kFloat));
    }
  }
  parts.push_back(at::tensor({finite ? 0.0f : 1.0f, stop_wanted ? 1.0f : 0.0f}));
  at::Tensor flat = at::cat(parts);
  ranks->Sum(flat);
  const int64_t end = flat.numel();
  if (flat[end - 1].item<float>() > 0) stop_agreed = true;
  if (flat[end - 2].item<float>() > 0) return false;
  flat /= static_cast<double>(world());
  int64_t at = 0;
  for (const Adam* adam : adams) {
    for (const Adam::Slot& slot : adam->slots) {
      const int64_t size = slot.value.numel();
      if (slot.value.grad().defined()) slot.value.grad().copy_(flat.slice(0, at, at + size).view(slot.value.sizes()));
      at += size;
    }
  }
  return true;
}

HistoryRow Trainer::State::MeanOverRanks(HistoryRow row) const {
  if (!ranks) return row;
  at::Tensor values = ValuesOf(row);
  ranks->Sum(values);
  SetValues(values / static_cast<double>(world()), &row);
  return row;
}

HistoryRow Trainer::State::ScoreOnFirstRank(const AvatarPack& validation) {
  HistoryRow row;
  if (!ranks || ranks->rank() == 0) row = ScoreHeldOut(validation);
  if (ranks) {
    at::Tensor values = ValuesOf(row);
    ranks->Broadcast(values);
    SetValues(values, &row);
    row.step = model.step, row.phase = "validation";
  }
  return row;
}

HistoryRow Trainer::State::Check(const AvatarPack& validation) {
  const HistoryRow row = ScoreOnFirstRank(validation);
  Judge(row);
  return row;
}

void Trainer::State::RequireSameBatches() const {
  const int64_t now = options.batch * world();
  if (images_per_step == 0 || images_per_step == now) return;
  throw UsageError("training took " + std::to_string(images_per_step) + " images a step so far and would take " +
                   std::to_string(now) + " now: go on with as many option 'ranks' as before, " +
                   std::to_string(images_per_step / options.batch));
}

void Trainer::Join(std::shared_ptr<const Ranks> ranks) {
  State& s = *state_;
  const at::Tensor own = SharedOf(s.pack, s.options, s.model.options, s.seed, s.model.step);
  at::Tensor first = own.clone();
  ranks->Broadcast(first);
  at::Tensor differs = first.ne(own).to(at::kDouble);
  ranks->Sum(differs);
  std::string what;
  for (size_t i = 0; i < kShared.size(); ++i) {
    if (differs[static_cast<int64_t>(i)].item<double>() > 0) what += (what.empty() ? "" : ", ") + std::string(kShared[i]);
  }
  if (!what.empty()) throw UsageError("the ranks differ in " + what + ": give all of them the same arguments");
  s.ranks = std::move(ranks);
  for (auto& [name, tensor] : s.Tensors()) {
    at::Tensor values = tensor.detach();
    s.ranks->Broadcast(values);
  }
}

}  // namespace mvstudio::avatar
