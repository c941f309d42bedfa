#pragma once

#include <chrono>
#include <functional>
#include <memory>

#include "avatar/train/train.h"
#include "stages/nets/avatar_run.h"
#include "stages/nets/train/options.h"
#include "stages/nets/train/report.h"

namespace mvstudio::stages {

/// What a method is trained on, and where its files go.
struct TrainingPlace {
  const avatar::RunConfig& config;
  const RunPacks& packs;
  AvatarRun& files;
  const RankTeam& team;
  std::function<void()>
      begin;  ///< removes an older run and writes the configuration; called once nothing can be refused any more
};

/// What a training that leaves no files came to.
struct MethodTrial {
  double seconds = 0;        ///< of its steps
  double scoring_s = 0;      ///< of the scores, where they are not among the steps
  std::vector<double> ssim;  ///< of each validation image, in the mask's box
};

/// A kind of avatar. When it is made, it refuses options of other kinds.
class TrainingMethod {
 public:
  virtual ~TrainingMethod() = default;
  /// Once the split is known: what it needs of crops and body. Throws UsageError.
  virtual void Prepare(avatar::RunConfig* config) = 0;
  /// Trains, writes, and fills the method's part of the report.
  virtual void Train(const TrainingPlace& place, const RunContext& run, AvatarTrainReport* report) = 0;
  /// Trains and scores in memory alone.
  virtual MethodTrial Try(const avatar::RunConfig& config, const RunPacks& packs, const RunContext& run) = 0;

  avatar::ModelOptions model;  ///< what crops must hold
  avatar::TrainOptions train;
};

/// The one list of methods. The options must outlive what is returned. Throws UsageError for options of other kinds.
std::unique_ptr<TrainingMethod> MakeMethod(const AvatarTrainOptions& options);
std::unique_ptr<TrainingMethod> MakeNetworkMethod(const AvatarTrainOptions& options);
std::unique_ptr<TrainingMethod> MakeGaussianMethod(const AvatarTrainOptions& options);

/// The net of the perceptual loss, null for none. What "auto" became is kept, so that a run goes on with the same.
std::shared_ptr<const avatar::FeatureNet> PerceptualNet(avatar::TrainOptions* options);

/// Joins the other ranks, trains with checkpoints on the way, and fills what is known of a network. `earlier_s`: seconds that
/// the run took before.
void TrainNetwork(avatar::Trainer& trainer, const avatar::TrainOptions& options, const TrainingPlace& place, double earlier_s,
                  const RunContext& run, AvatarTrainReport* report);

/// What the report says of the images.
void FillImages(const avatar::RunConfig& config, const RunPacks& packs, AvatarTrainReport* report);

inline double SecondsNow() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace mvstudio::stages
