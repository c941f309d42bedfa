#include <optional>

#include "core/disk/output.h"
#include "core/error.h"
#include "stages/nets/train/method.h"
#include "stages/nets/train/run.h"

namespace mvstudio::stages {
namespace {

/// A checkpoint from elsewhere must not choose code that is run: a TorchScript file is named by who runs it.
void SettlePerceptual(const AvatarResumeOptions& options, const std::string& path, avatar::TrainOptions* train) {
  const std::string& then = train->perceptual;
  const bool file = then != "none" && then != "auto" && then != "posenet" && train->weight_perceptual != 0;
  if (!options.perceptual.empty()) {
    train->perceptual = options.perceptual;
  } else if (file) {
    throw UsageError(path + ": was trained with the TorchScript file '" + then +
                     "', and such a file is a program: give it as option 'perceptual' FILE");
  }
}

/// As then, with what is asked for now.
avatar::TrainOptions TrainOptionsNow(const AvatarResumeOptions& options, const avatar::TensorFile& checkpoint,
                                     const std::string& path) {
  avatar::TrainOptions train = avatar::TrainOptionsFrom(checkpoint, path);
  if (options.steps >= 0) train.steps = options.steps;
  if (options.patience >= 0) train.patience = options.patience;
  if (!options.device.empty()) train.device = options.device;
  avatar::ResolveDevice(train.device);  // which the run may have had on another machine
  SettlePerceptual(options, path, &train);
  return train;
}

}  // namespace

AvatarTrainReport RunAvatarResume(const AvatarResumeOptions& options, RunContext run) {
  const double begin_s = SecondsNow();
  if (!options.device.empty()) avatar::ResolveDevice(options.device);
  if (avatar::HoldsGaussians(options.run))
    throw UsageError(options.run +
                     " holds Gaussians, which cannot be resumed: train them again with option 'overwrite' and more option "
                     "'steps'");
  AvatarRun files(options.run);
  avatar::RunConfig config = avatar::ReadRunConfig(files.Path(avatar::kRunConfigFile));
  const std::string path = files.checkpoint_path();
  avatar::RequireCheckpoint(path);
  const avatar::TensorFile checkpoint = avatar::ReadTensorFile(path);
  avatar::TrainOptions train = TrainOptionsNow(options, checkpoint, path);
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(config.dataset);
  std::optional<OutputFolder> place;
  if (options.ranks.rank == 0) place.emplace(options.run, std::vector<std::string>{config.dataset}, AvatarRun::Names());
  config.pack.shape = config.shape, config.pack.half_extent_m = config.half_extent_m, config.pack.fit_shape = false;
  const RankTeam team = options.ranks.start ? options.ranks.start(avatar::RanksFrom(checkpoint, path)) : RankTeam{};
  if (team.threads > 0) run.num_threads = team.threads;
  const avatar::ModelOptions model = ModelOptionsFrom(checkpoint, path);
  const RunPacks packs = BuildPacks(data, model, train, run, &config, ReadReferences(options.run, config, model));
  const auto net = PerceptualNet(&train);
  avatar::Trainer trainer(packs.train, checkpoint, path, train, run, net);
  AvatarTrainReport report;
  report.rank = team.rank, report.folder = options.run, report.resumed_from = trainer.model().step;
  const double earlier_s = team.first() ? files.ContinueHistory(trainer.model().step) : 0;
  TrainNetwork(trainer, train, {config, packs, files, team, {}}, earlier_s, run, &report);
  if (!team.first()) return report;
  FillImages(config, packs, &report);
  report.outputs = files.Outputs();
  report.whole_s = SecondsNow() - begin_s;
  return report;
}

}  // namespace mvstudio::stages
