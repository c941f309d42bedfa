#pragma once

#include <ATen/core/Tensor.h>

#include <array>
#include <string_view>
#include <vector>

#include "avatar/nets/discriminator.h"
#include "avatar/nets/feature_net.h"
#include "avatar/nets/model.h"
#include "avatar/settings/options.h"
#include "avatar/train/batch.h"

namespace mvstudio::avatar {

/// Names of the loss terms, the weighted sum first; columns of a history.
inline constexpr std::array<const char*, 13> kLossColumns = {
    "total", "l1", "ssim", "gradient", "perceptual", "mask", "part", "uv", "logit", "gan", "features", "warp", "discriminator"};
/// Position in kLossColumns; ContractViolation for an unknown name.
size_t LossColumn(std::string_view name);

/// The terms of one step, unweighted and detached, and their weighted sum with gradients.
class LossTerms {
 public:
  void Add(std::string_view name, double weight, const at::Tensor& value);
  /// A term of another network's loss: recorded, not summed.
  void Keep(std::string_view name, const at::Tensor& value);
  /// Sets the total to NaN for outputs that are not finite.
  void SetNotFinite(const at::Tensor& like);

  const at::Tensor& total() const { return total_; }
  double Value(size_t column) const;  ///< 0 for terms that are not there
  at::Tensor image;  ///< (B, 3, H, W) the image that was compared, detached; undefined before textures are ready

 private:
  at::Tensor total_;
  std::array<at::Tensor, kLossColumns.size()> values_;
};

/// Inputs of a loss beside the model; all are optional.
struct LossContext {
  const FeatureNet* perceptual = nullptr;
  Discriminator* discriminator = nullptr;
  bool half_precision = false;  ///< of the generator's convolutions, on a GPU
};

/// Target of the generator's output: a batch, and for `v2v` the previous images.
struct StepInput {
  TrainBatch batch;
  at::Tensor previous;        ///< (B, 3 kNumPrevious, H, W) rendered before; undefined without memory
  at::Tensor previous_truth;  ///< (B, 3, H, W), black where there is none
  at::Tensor has_previous;    ///< (B) float, 1 or 0
  at::Tensor totals;          ///< of several processes, see LossTotals; undefined: those of this batch
};

/// Divisors of the losses' weighted sums over pixels, (5) float32: image, SSIM, person, rest, moving pixels.
at::Tensor LossTotals(const StepInput& input, double foreground_weight);

/// The loss of one step. `init`: only the initialisation terms.
LossTerms ComputeLoss(AvatarModel& model, const TrainOptions& options, const StepInput& input, bool init,
                      const LossContext& context);

/// The discriminator's own loss on the truth and on an image generated without it.
at::Tensor DiscriminatorLoss(Discriminator& discriminator, const TrainBatch& batch, const at::Tensor& image);

}  // namespace mvstudio::avatar
