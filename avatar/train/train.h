#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "avatar/data/pack.h"
#include "avatar/nets/feature_net.h"
#include "avatar/nets/model.h"
#include "avatar/nets/transfer.h"
#include "avatar/settings/options.h"
#include "avatar/train/loss_terms.h"
#include "avatar/train/train_ranks.h"
#include "core/progress.h"
#include "core/status.h"

namespace mvstudio::avatar {

/// Mean loss terms, unweighted, of the steps since the previous row.
struct HistoryRow {
  int64_t step = 0;
  std::string phase;                                 ///< "init", "train" or "validation"
  std::array<double, kLossColumns.size()> values{};  ///< by kLossColumns; 0 for terms that the method lacks
  double operator[](std::string_view column) const { return values[LossColumn(column)]; }
};

struct TrainReport {
  Status status =
      Status::kOk;      ///< kNonFiniteInput when the NaN guard stopped the run, kNotConverged when the loss did not fall
  std::string message;  ///< one line when not kOk: batch, cameras and frames; or why training ended early
  std::vector<HistoryRow> history;
  int64_t steps_done = 0;    ///< in this run
  int64_t best_step = -1;    ///< of the weights returned, with `patience`; -1: the last
  bool stopped = false;      ///< the callback, here or on another rank, requested a stop
  bool ended_early = false;  ///< `patience` was exhausted
  /// SSIM that the network adds to the template it began with, on the validation images at the last check; NaN: not judged,
  /// for want of such images, of `least_gain` or of a template.
  double gain = std::nan("");
  bool network_off = false;  ///< the gain is below `least_gain`: the template is returned without the network
};

/// Called after each step; `row` is null between reports. Returning false stops the training after this step.
using StepCallback = std::function<bool(int64_t step, const HistoryRow* row)>;

/// Training that can be saved and resumed: the same seed, options and thread count give the same bytes, whether the run
/// was interrupted or not. Batches and jitter are functions of (seed, step) alone.
class Trainer {
 public:
  /// Fresh start. Throws UsageError when the options do not fit the pack. Sets the number of threads of ATen. `perceptual`: the
  /// net of the perceptual loss; null for none.
  Trainer(const AvatarPack& pack, const ModelOptions& model, const TrainOptions& options, const RunContext& run,
          std::shared_ptr<const FeatureNet> perceptual = nullptr);
  /// Continues from a checkpoint's tensors; `options` may increase the steps. The seed is the checkpoint's. Throws
  /// UsageError when `perceptual` is not the net that it was trained with. Run throws it when the ranks use a different
  /// number of images per step.
  Trainer(const AvatarPack& pack, const TensorFile& checkpoint, const std::string& path, const TrainOptions& options,
          const RunContext& run, std::shared_ptr<const FeatureNet> perceptual = nullptr);
  /// Starts from another avatar's network (the paper's transfer to a new person), which is trained on; textures are averaged
  /// from `pack`. Where it is initialised there are no initialisation steps unless the options ask for some.
  Trainer(const AvatarPack& pack, StartNetwork start, const TrainOptions& options, const RunContext& run,
          std::shared_ptr<const FeatureNet> perceptual = nullptr);
  ~Trainer();
  Trainer(Trainer&&) noexcept;

  /// Before Run, method `hf`: the fitted body's colours (24, 3, S', S') in [-1, 1], which its renderer sees and no step
  /// changes.
  void SetBodyTextures(const at::Tensor& textures);

  /// The steps that follow train `other`'s network, of the same options: its weights and Adam's moments are those of both from
  /// now on, textures stay apart. Several people thus train one renderer when they take turns, each after the one before.
  void TakeNetwork(const Trainer& other);

  /// Before Run: each step then uses `batch` images on every rank and the mean of their gradients. This equals one process
  /// with a batch larger by the number of ranks (with instance normalisation; running statistics are of rank 0's images).
  /// All ranks must have the same pack, options, seed and step; throws UsageError otherwise. They end together.
  void Join(std::shared_ptr<const Ranks> ranks);

  /// Runs until init_steps + steps are done, `until_step` (when not negative) is reached or the callback requests a stop.
  /// A loss or gradient that is not finite ends the run with the weights and textures of the previous step.
  TrainReport Run(const AvatarPack* validation, const StepCallback& callback, int64_t until_step = -1);

  /// The steps that follow are of these images, as many and of the same kind as those before.
  void ReplaceImages(const AvatarPack& pack);

  /// The model in training: the last weights.
  AvatarModel& model();
  /// Initialisation and end-to-end steps together.
  int64_t total_steps() const;
  /// "cpu" or "cuda".
  const std::string& device() const;
  /// Calls `use` with the weights that a checkpoint returns: the best with `patience`, the average with `ema`, else the
  /// last.
  void UseHanded(const std::function<void(AvatarModel&)>& use);
  /// Everything needed to continue: weights, textures, Adam's moments, step, seed, options.
  TensorFile Checkpoint() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// "auto" becomes cuda or cpu. Throws MissingToolError when a GPU is requested and libtorch finds none.
std::string ResolveDevice(const std::string& device);

/// Number of processes that trained a checkpoint: its steps use `batch` images from each.
int RanksFrom(const TensorFile& checkpoint, const std::string& path);

/// Training options stored in a checkpoint.
TrainOptions TrainOptionsFrom(const TensorFile& checkpoint, const std::string& path);

/// Initialises, averages the textures, trains end to end: the whole method in one call.
TrainReport TrainTna(const AvatarPack& pack, const AvatarPack* validation, const ModelOptions& model,
                     const TrainOptions& options, const RunContext& run, const StepCallback& callback, AvatarModel* result);

}  // namespace mvstudio::avatar
