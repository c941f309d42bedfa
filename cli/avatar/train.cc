#include <filesystem>

#include "cli/program/commands.h"
#include "cli/program/interrupt.h"
#include "cli/program/options.h"
#include "cli/program/redact.h"
#include "cli/program/result.h"
#include "core/error.h"
#include "stages/dataset/studio_names.h"
#include "stages/nets/train/describe.h"
#include "stages/nets/train/rank_processes.h"
#include "stages/nets/train/run.h"

namespace mvstudio::cli {
namespace {

/// Of a training that `srun` started: a scheduler is told to try again.
template <class Run>
CommandResult UnlessCut(const stages::RankArguments& ranks, const Run& run) {
  try {
    return run();
  } catch (const CancelledError& error) {
    if (!ranks.BySrun()) throw;
    CommandResult result = InterruptedResult(ReceivedSignal(), error.what());
    result.exit = kExitTryAgain;
    return result;
  }
}

void RegisterTrain(CLI::App& avatar, Registry& registry) {
  auto options = std::make_shared<stages::AvatarTrainOptions>();
  auto ranks = std::make_shared<stages::RankArguments>();
  CLI::App* sub = avatar.add_subcommand("train", "Train an avatar on a Panoptic-style dataset with masks");
  StartGroup(sub, "Data");
  AddOption(sub, "dataset", options->dataset, "dataset folder")->required();
  AddOptions(sub, *options);
  sub->get_option("--out")->required();
  StartGroup(sub, "Machine");
  AddOptions(sub, *ranks);
  registry.Add(sub, "avatar train", [options, ranks, sub](CommandContext& context) {
    context.camera_names = stages::StudioNames(options->dataset);
    options->given = GivenOptions(sub), options->relative_paths = Redacting();
    options->ranks = RanksOf(*ranks, context.argv, context.run, options->out);
    return UnlessCut(*ranks, [&] { return Describe(stages::RunAvatarTrain(*options, context.run)); });
  });
}

void RegisterResume(CLI::App& avatar, Registry& registry) {
  auto options = std::make_shared<stages::AvatarResumeOptions>();
  auto ranks = std::make_shared<stages::RankArguments>();
  ranks->ranks = 0;  // as many as before
  CLI::App* sub = avatar.add_subcommand("resume", "Continue an interrupted or finished training run");
  AddOutput(sub, "run", options->run, OutputKind::kFolder, "folder of the run")->required();
  AddOptions(sub, *options);
  AddOptions(sub, *ranks);
  sub->get_option("--ranks")->description("processes on this machine, as in `avatar train`; 0: as many as before");
  registry.Add(sub, "avatar resume", [options, ranks](CommandContext& context) {
    const std::string config = options->run + "/" + avatar::kRunConfigFile;
    if (std::filesystem::exists(config)) context.camera_names = stages::StudioNames(avatar::ReadRunConfig(config).dataset);
    options->ranks = RanksOf(*ranks, context.argv, context.run, options->run);
    return UnlessCut(*ranks, [&] { return Describe(stages::RunAvatarResume(*options, context.run)); });
  });
}

}  // namespace

void RegisterAvatarTrain(CLI::App& avatar, Registry& registry) {
  RegisterTrain(avatar, registry);
  RegisterResume(avatar, registry);
  RegisterAvatarInfo(avatar, registry);
}

}  // namespace mvstudio::cli
