#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/dataset/studio_names.h"
#include "stages/nets/evaluate/describe.h"

namespace mvstudio::cli {

void RegisterAvatarEval(CLI::App& avatar, Registry& registry) {
  auto options = std::make_shared<stages::AvatarEvalOptions>();
  CLI::App* sub =
      avatar.add_subcommand("eval", "Score a trained avatar on the cameras and frames it never saw, beside simple baselines");
  AddOutput(sub, "run", options->run_folder, OutputKind::kFolder, "folder of the training run (--out of `avatar train`)")
      ->required();
  AddOptions(sub, *options);
  registry.Add(sub, "avatar eval", [options](CommandContext& context) {
    const std::string& dataset = options->scores.dataset;
    context.camera_names = stages::StudioNames(avatar::OpenRun(options->run_folder, dataset).dataset);
    return Describe(stages::RunAvatarEval(*options, context.run));
  });
}

}  // namespace mvstudio::cli
