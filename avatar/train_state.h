#pragma once

#include <memory>
#include <string>
#include <vector>

#include "avatar/adam.h"
#include "avatar/train.h"

/// What a Trainer holds, shared by train*.cc alone.
namespace mvstudio::avatar {

/// Evenly spread rows, at most `count`.
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
  LossContext Context() { return {perceptual.get(), v2v() ? &critic : nullptr}; }

  /// Checks options against the pictures, moves everything to the device, makes the optimisers.
  void Prepare(const AvatarPack& source, const RunContext& run);
  void PrepareVideo(const at::Device& device);

  StepInput MakeInput(const AvatarPack& source, const std::vector<int64_t>& previous, const std::vector<int64_t>& rows,
                      bool jitter, int64_t step);
  /// Average colours under the network's own part and coordinate predictions.
  void AverageTextures();

  double RateFactor() const;
  /// Gradients of the discriminator's own loss; returns their norm, NaN when the loss is not finite.
  double CriticGradients(const StepInput& input, LossTerms* terms);
  /// One step. Returns false, with nothing changed, when the loss or a gradient is not finite.
  bool Step(const StepInput& input, LossTerms* terms);
  HistoryRow ScoreHeldOut(const AvatarPack& validation);

  /// Moments, discriminator and flags of a checkpoint; the model is there already.
  void TakeUp(const TensorFile& file, const std::string& path);
  void LoadCritic(const TensorFile& file, const std::string& path);
};

}  // namespace mvstudio::avatar
