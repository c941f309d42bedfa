#include <ATen/ATen.h>
#include <torch/torch.h>

#include "avatar/maps/template_maps.h"
#include "avatar/maps/texture.h"
#include "avatar/nets/sequence.h"
#include "avatar/train/batch.h"
#include "avatar/train/train_state.h"

namespace mvstudio::avatar {
namespace {

/// What the network rendered of the two frames before the batch's, under the same jitter; each begins without a past.
void AddPast(AvatarModel& model, const std::vector<int64_t>& previous, const std::vector<int64_t>& rows,
             const std::function<TrainBatch(const std::vector<int64_t>&)>& batch_of, StepInput* input) {
  const auto step_back = [&](const std::vector<int64_t>& from, std::vector<int64_t>* to) {
    at::Tensor has = at::zeros({static_cast<int64_t>(from.size())}, at::kFloat);
    to->clear();
    for (size_t i = 0; i < from.size(); ++i) {
      const int64_t before = previous[from[i]];
      to->push_back(before < 0 ? from[i] : before);  // any row: its image is blacked out
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
    const auto [first, second] = Predict(model, batch.maps, past);
    return CleanImage(model, first, second, background, past).clamp(0, 1);
  };
  const at::Tensor image2 = has2 * render(batch2, at::cat({black, black}, 1));
  const at::Tensor image1 = has1 * render(batch1, at::cat({image2, black}, 1));
  input->previous = at::cat({image1, image2}, 1);
  input->previous_truth = has1 * batch1.image;
  input->has_previous = has1.view({-1});
}

void AddImage(const at::Tensor& prob, const at::Tensor& uv, const TrainBatch& batch, TextureSums* sums) {
  const at::Tensor part = prob.slice(1, 1).argmax(1) + 1, channel = (part - 1).unsqueeze(1);
  const at::Tensor u = uv.slice(1, 0, 24).gather(1, channel).flatten(), v = uv.slice(1, 24, 48).gather(1, channel).flatten();
  const at::Tensor pixels = batch.mask.to(at::kCPU).flatten().ge(0.5).nonzero().squeeze(1);
  const at::Tensor colour = batch.image.to(at::kCPU)[0].reshape({3, -1}).t() * 2 - 1;
  const at::Tensor weight = prob.gather(1, part.unsqueeze(1)).flatten();
  AddPixels(*sums, part.flatten().index_select(0, pixels), at::stack({u, v}, 1).index_select(0, pixels),
            colour.index_select(0, pixels), weight.index_select(0, pixels));
}

/// Colours by the first guess, with a small weight: they count where the network's predictions leave texels open, as after a
/// short initialisation, when it does not yet tell all parts.
void AddGuess(const AvatarPack& pack, int64_t row, TextureSums* sums) {
  constexpr double kWeight = 0.1;
  const at::Tensor part = pack.part[row].to(at::kLong).flatten();
  const at::Tensor pixels = part.gt(0).logical_and(pack.masks[row].flatten().ge(128)).nonzero().squeeze(1);
  const at::Tensor uv = pack.uv[row].reshape({2, -1}).t() * 2 - 1;
  const at::Tensor colour = pack.images[row].to(at::kFloat).reshape({3, -1}).t() * (2.0 / 255) - 1;
  AddPixels(*sums, part.index_select(0, pixels), uv.index_select(0, pixels), colour.index_select(0, pixels),
            at::full({pixels.size(0)}, kWeight, at::kFloat));
}

}  // namespace

std::vector<int64_t> SpreadRows(int64_t total, int64_t count) {
  std::vector<int64_t> rows;
  const int64_t wanted = std::min(total, count);
  for (int64_t i = 0; i < wanted; ++i) rows.push_back((2 * i + 1) * total / (2 * wanted));
  return rows;
}

StepInput Trainer::State::MakeInput(const AvatarPack& source, const std::vector<int64_t>& previous,
                                    const std::vector<int64_t>& rows, bool jitter, int64_t step) {
  const int64_t first = jitter && ranks ? ranks->rank() * options.batch : 0;
  const auto batch_of = [&](const std::vector<int64_t>& some) {
    return MakeBatch(source, model, options, some, jitter, seed, step, first);
  };
  StepInput input;
  input.batch = batch_of(rows);
  if (v2v()) AddPast(model, previous, rows, batch_of, &input);
  if (jitter && ranks) {
    at::Tensor totals = LossTotals(input, options.foreground_weight).to(at::kCPU);
    ranks->Sum(totals);
    input.totals = (totals / static_cast<double>(world())).to(input.batch.mask.device());
  }
  return input;
}

void Trainer::State::AverageTextures() {
  torch::NoGradGuard no_grad;
  model.generator->eval();
  TextureSums sums = ZeroTextureSums(model.options.texture_px);
  for (const int64_t row : SpreadRows(pack.size(), options.texture_images)) {
    const TrainBatch batch = MakeBatch(pack, model, options, {row}, false, seed, 0);
    const auto [logits, raw_uv] = Predict(model, batch.maps);
    AddImage(at::softmax(logits, 1).to(at::kCPU), CoordinatesOf(model.options, raw_uv).to(at::kCPU), batch, &sums);
  }
  constexpr int64_t kGuessesPerImage = 4;  // they cost no run of the network
  for (const int64_t row : SpreadRows(pack.size(), kGuessesPerImage * options.texture_images)) AddGuess(pack, row, &sums);
  model.textures.copy_(FillTextures(sums));
  model.seen.copy_(sums.weight);
  textures_ready = true;
  if (ranks) ranks->Broadcast(model.textures), ranks->Broadcast(model.seen);
  average.erase("textures");  // grey until now
}

}  // namespace mvstudio::avatar
