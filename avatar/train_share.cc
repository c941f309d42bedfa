#include <torch/torch.h>

#include "avatar/batch.h"
#include "avatar/train_state.h"
#include "core/check.h"
#include "core/error.h"

/// What several processes that train together tell each other.
namespace mvstudio::avatar {
namespace {

at::Tensor ValuesOf(const HistoryRow& row) {
  return at::tensor(at::ArrayRef<double>(row.values.data(), row.values.size()), at::kDouble);
}

void SetValues(const at::Tensor& values, HistoryRow* row) {
  std::copy_n(values.data_ptr<double>(), row->values.size(), row->values.begin());
}

}  // namespace

std::vector<int64_t> Trainer::State::RowsOfStep(int64_t step, bool all) const {
  const std::vector<int64_t> rows = PicturesOfStep(pack.size(), options.batch * world(), seed, step);
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

HistoryRow Trainer::State::Check(const AvatarPack& validation) {
  HistoryRow row;
  if (!ranks || ranks->rank() == 0) row = ScoreHeldOut(validation);
  if (ranks) {
    at::Tensor values = ValuesOf(row);
    ranks->Broadcast(values);
    SetValues(values, &row);
    row.step = model.step, row.phase = "validation";
  }
  Judge(row);
  return row;
}

void Trainer::Join(std::shared_ptr<const Ranks> ranks) {
  State& s = *state_;
  const auto own = [&] {
    return at::tensor(
        {static_cast<double>(s.pack.size()), static_cast<double>(s.pack.size_px), static_cast<double>(s.options.batch),
         static_cast<double>(s.seed % (uint64_t{1} << 52)), static_cast<double>(s.model.step),
         static_cast<double>(s.total_steps()), static_cast<double>(NumParameters(s.model.options))},
        at::kDouble);
  };
  at::Tensor first = own();
  ranks->Broadcast(first);
  at::Tensor differs = first.ne(own()).any().to(at::kDouble);
  ranks->Sum(differs);
  if (differs.item<double>() > 0)
    throw UsageError("the ranks differ in pictures, size, batch, seed, steps or network: give all of them the same arguments");
  s.ranks = std::move(ranks);
  for (auto& [name, tensor] : s.Tensors()) {
    at::Tensor values = tensor.detach();
    s.ranks->Broadcast(values);
  }
}

}  // namespace mvstudio::avatar
