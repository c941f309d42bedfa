#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/nets/info/describe.h"

namespace mvstudio::cli {

void RegisterAvatarInfo(CLI::App& avatar, Registry& registry) {
  const auto options = std::make_shared<avatar::ModelOptions>(avatar::PaperModel());
  const auto run = std::make_shared<std::string>();
  CLI::App* info = avatar.add_subcommand("info", "Size of a network (defaults: the published one) or of a trained run");
  AddOption(info, "run", *run, "folder of a run; without it the options below are used");
  AddOptions(info, *options);
  registry.Add(info, "avatar info",
               [run, options](CommandContext&) { return Describe(stages::InfoOfNetwork(*run, *options)); });
}

}  // namespace mvstudio::cli
