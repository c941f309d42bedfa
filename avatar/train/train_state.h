#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "avatar/train/adam.h"
#include "avatar/train/train.h"

/// State of a Trainer, shared only by the .cc files of this folder.
namespace mvstudio::avatar {

/// Evenly spaced rows, at most `count`.
std::vector<int64_t> SpreadRows(int64_t total, int64_t count);

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

using NamedTensors = std::map<std::string, at::Tensor>;

struct Trainer::State {
  AvatarPack pack;       // labels fitted to the masks
  TrainOptions options;  // every choice made
  AvatarModel model;
  Discriminator critic{nullptr};  // v2v alone
  Adam network, texels, critic_weights;
  std::shared_ptr<const FeatureNet> perceptual;
  std::vector<int64_t> previous_rows;  // v2v alone
  uint64_t seed = 1;
  std::shared_ptr<const Ranks> ranks;             // null: alone
  bool stop_wanted = false, stop_agreed = false;  // of several ranks: by this one; by any, told in the gradients
  bool textures_ready = false;
  bool initialised = false;     // the network knew parts and coordinates before the textures were averaged
  int64_t images_per_step = 0;  // of all ranks so far; 0: not begun
  std::string asked_device;     // as in the options given; options.device is the one in use
  NamedTensors average;         // running averages of weights and textures, with `ema`
  NamedTensors best;            // all tensors of the best check, with `patience`
  int64_t best_step = -1, idle_checks = 0;
  double best_score = 0;
  at::Tensor start_textures;         // of the template alone, where the network's gain is judged
  double start_ssim = std::nan("");  // 1 - SSIM of the template alone on the validation images
  double last_ssim = std::nan("");   // the same of the weights of the last check
  double loss_scale = 1;             // with `amp`
  int64_t steps_since_scale = 0;     // since it changed

  bool v2v() const { return model.options.method == Method::kV2v; }
  bool tna() const { return model.options.method == Method::kTna; }
  bool hf() const { return model.options.method == Method::kHf; }
  int64_t total_steps() const { return int64_t{options.init_steps} + options.steps; }
  bool InInit() const { return tna() && model.step < options.init_steps; }
  bool Exhausted() const { return options.patience > 0 && idle_checks >= options.patience; }
  LossContext Context() { return {perceptual.get(), v2v() ? &critic : nullptr, options.amp}; }

  /// Checks options against the images, moves everything to the device, creates the optimisers.
  void Prepare(const AvatarPack& source, const RunContext& run, bool transferred = false);
  void PrepareVideo(const at::Device& device);

  StepInput MakeInput(const AvatarPack& source, const std::vector<int64_t>& previous, const std::vector<int64_t>& rows,
                      bool jitter, int64_t step);
  /// Average colours under the network's own part and coordinate predictions.
  void AverageTextures();

  double RateFactor() const;
  /// Gradients of the discriminator's own loss; returns their norm, NaN when the loss is not finite.
  double CriticGradients(const StepInput& input, LossTerms* terms);
  /// Norm of all gradients for the batch; NaN when the loss or one of them is not finite.
  double Gradients(const StepInput& input, LossTerms* terms);
  /// Throws UsageError when the remaining steps would use other images than the previous ones.
  void RequireSameBatches() const;
  int64_t world() const { return ranks ? ranks->size() : 1; }
  /// The rows of this rank in a step; `all`: of every rank.
  std::vector<int64_t> RowsOfStep(int64_t step, bool all) const;
  /// Replaces gradients by their means over the ranks; false on every rank when one had gradients that are not finite.
  bool ShareGradients(const std::vector<Adam*>& adams, bool finite);
  HistoryRow MeanOverRanks(HistoryRow row) const;
  /// Sets the gradients of texels that no image showed to 0.
  void FreezeUnseen();
  /// One step. Returns false, without any change, when the loss or a gradient is not finite.
  bool Step(const StepInput& input, LossTerms* terms);
  bool CheckDue() const;
  /// ScoreHeldOut by rank 0 alone, told to all ranks.
  HistoryRow ScoreOnFirstRank(const AvatarPack& validation);
  /// Scores the weights that would be returned if they were the best, and records whether they are.
  HistoryRow Check(const AvatarPack& validation);
  std::string WhyEndedEarly() const;
  HistoryRow ScoreHeldOut(const AvatarPack& validation);

  /// The model's own tensors by their names in a checkpoint: weights, running statistics, textures.
  NamedTensors Tensors() const;
  /// The weights that a checkpoint returns instead of the last ones; empty: none.
  NamedTensors Handed() const;
  /// Scores the template before the first step, where the network's gain is to be judged.
  void ScoreStart(const AvatarPack& validation);
  double Gain() const { return start_ssim - last_ssim; }  // NaN: not judged
  /// Whether training is over and the network added too little to be kept.
  bool NetworkIsOff() const;
  void UpdateAverage();
  void Judge(const HistoryRow& row);

  /// Restores moments, discriminator and flags of a checkpoint, after the model.
  void Restore(const TensorFile& file, const std::string& path);
  void SaveHanded(TensorFile* file) const;
  void RestoreGivenWeights(const TensorFile& file, const std::string& path);
  void LoadCritic(const TensorFile& file, const std::string& path);
};

/// Replaces the model's weights by `values` during its lifetime.
class BorrowedWeights {
 public:
  BorrowedWeights(const NamedTensors& model, const NamedTensors& values);
  ~BorrowedWeights();
  BorrowedWeights(const BorrowedWeights&) = delete;
  BorrowedWeights& operator=(const BorrowedWeights&) = delete;

 private:
  NamedTensors model_, saved_;
};

}  // namespace mvstudio::avatar
