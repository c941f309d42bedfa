#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/surface/describe.h"

namespace mvstudio::cli {

void RegisterAvatarSurface(CLI::App& avatar, Registry& registry) {
  const auto options = std::make_shared<stages::SurfaceOptions>();
  CLI::App* sub = avatar.add_subcommand("surface", "Fitted bodies beside the true surface of a rendered person");
  AddOption(sub, "bodies", options->bodies, "body.npz files of avatar fit")->required();
  AddOptions(sub, *options);
  sub->get_option("--truth")->required();
  registry.Add(sub, "avatar surface",
               [options](CommandContext& context) { return Describe(stages::RunSurface(*options, context.run)); });
}

}  // namespace mvstudio::cli
