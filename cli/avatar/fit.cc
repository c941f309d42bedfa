#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/dataset/studio_names.h"
#include "stages/nets/fit/describe.h"

namespace mvstudio::cli {

void RegisterAvatarFit(CLI::App& avatar, Registry& registry) {
  auto options = std::make_shared<stages::AvatarFitOptions>();
  CLI::App* sub = avatar.add_subcommand("fit", "Fit a body to a person's joints and silhouettes, and average its colours");
  AddOption(sub, "dataset", options->dataset, "dataset folder")->required();
  AddOptions(sub, *options);
  sub->get_option("--out")->required();
  sub->get_option("--max-silhouettes")->check(CLI::Range(1, 100000));
  sub->get_option("--max-px")->check(CLI::Range(64, 4096));
  sub->get_option("--texture-px")->check(CLI::Range(8, 1024));
  sub->get_option("--network-steps")->check(CLI::Range(1, 1000000));
  sub->get_option("--fps")->check(CLI::Range(0.1, 1000.0));
  registry.Add(sub, "avatar fit", [options](CommandContext& context) {
    context.camera_names = stages::StudioNames(options->dataset);
    return Describe(stages::RunAvatarFit(*options, context.run));
  });
  RegisterAvatarTexture(avatar, registry);
  RegisterAvatarEdit(avatar, registry);
}

}  // namespace mvstudio::cli
