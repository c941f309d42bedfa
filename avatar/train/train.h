#pragma once

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "avatar/data/pack.h"
#include "avatar/nets/feature_net.h"
#include "avatar/nets/model.h"
#include "avatar/settings/options.h"
#include "avatar/train/loss_terms.h"
#include "avatar/train/train_ranks.h"
#include "core/progress.h"
#include "core/status.h"

namespace mvstudio::avatar {

/// Mean loss terms, unweighted, of the steps since the row before.
struct HistoryRow {
  int64_t step = 0;
  std::string phase;                                 ///< "init", "train" or "validation"
  std::array<double, kLossColumns.size()> values{};  ///< by kLossColumns; 0 for terms that the method has not
  double operator[](std::string_view column) const { return values[LossColumn(column)]; }
};

struct TrainReport {
  Status status =
      Status::kOk;      ///< kNonFiniteInput when the NaN guard stopped the run, kNotConverged when the loss did not fall
  std::string message;  ///< one line when not kOk: batch, cameras and frames; or why training ended early
  std::vector<HistoryRow> history;
  int64_t steps_done = 0;    ///< in this run
  int64_t best_step = -1;    ///< of the weights handed out, with `patience`; -1: the last
  bool stopped = false;      ///< the callback, here or on another rank, said stop
  bool ended_early = false;  ///< `patience` was over
};

/// Called after each step; `row` is null between reports. Returning false stops the training after this step.
using StepCallback = std::function<bool(int64_t step, const HistoryRow* row)>;

/// Training state that can be saved and taken up again: the same seed, options and thread count give the same bytes, whether
/// the run was interrupted or not. Batches and jitter are functions of (seed, step) alone.
class Trainer {
 public:
  /// Fresh start. Throws UsageError when the options do not fit the pack. Sets the number of threads of ATen. `perceptual`: the
  /// net of the perceptual loss; null for none.
  Trainer(const AvatarPack& pack, const ModelOptions& model, const TrainOptions& options, const RunContext& run,
          std::shared_ptr<const FeatureNet> perceptual = nullptr);
  /// Continues from a checkpoint's tensors; `options` may ask for more steps. The seed is the checkpoint's. Throws UsageError
  /// when `perceptual` is not the net that it was trained with; Run does when the ranks take not as many pictures a step.
  Trainer(const AvatarPack& pack, const TensorFile& checkpoint, const std::string& path, const TrainOptions& options,
          const RunContext& run, std::shared_ptr<const FeatureNet> perceptual = nullptr);
  /// Fresh start from another avatar's network (the paper's transfer to a new person): its weights and depth range are kept,
  /// textures are averaged anew from `pack`. `texture_px`: their size, 0: as always.
  Trainer(const AvatarPack& pack, const AvatarModel& from, int texture_px, const TrainOptions& options, const RunContext& run,
          std::shared_ptr<const FeatureNet> perceptual = nullptr);
  ~Trainer();
  Trainer(Trainer&&) noexcept;

  /// Before Run: from now on each step takes `batch` pictures on every rank and the mean of their gradients, which is what one
  /// process does with a batch as many times as large (with instance normalisation; running statistics are of rank 0's
  /// pictures). All ranks must have the same pack, options, seed and step; throws UsageError when they have not. They end
  /// together.
  void Join(std::shared_ptr<const Ranks> ranks);

  /// Runs until init_steps + steps are done, `until_step` (when not negative) is reached or the callback says stop. A loss or
  /// gradient that is not finite ends the run with the weights and textures of the step before.
  TrainReport Run(const AvatarPack* validation, const StepCallback& callback, int64_t until_step = -1);

  /// The model as it is trained: the last weights.
  AvatarModel& model();
  /// Initialisation and end-to-end steps together.
  int64_t total_steps() const;
  /// "cpu" or "cuda".
  const std::string& device() const;
  /// Calls `use` with the weights that a checkpoint hands out: the best with `patience`, the average with `ema`, else the last.
  void UseHanded(const std::function<void(AvatarModel&)>& use);
  /// Everything needed to continue: weights, textures, Adam's moments, step, seed, options.
  TensorFile Checkpoint() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// "auto" becomes cuda or cpu. Throws MissingToolError when a GPU is asked for and libtorch finds none.
std::string ResolveDevice(const std::string& device);

/// How many processes trained a checkpoint: its steps take `batch` pictures of each.
int RanksFrom(const TensorFile& checkpoint, const std::string& path);

/// Training options kept in a checkpoint.
TrainOptions TrainOptionsFrom(const TensorFile& checkpoint, const std::string& path);

/// Initialise, average the textures, train end to end: the whole method in one call.
TrainReport TrainTna(const AvatarPack& pack, const AvatarPack* validation, const ModelOptions& model,
                     const TrainOptions& options, const RunContext& run, const StepCallback& callback, AvatarModel* result);

}  // namespace mvstudio::avatar
