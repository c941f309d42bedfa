#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/avatar_compare/describe.h"

namespace mvstudio::cli {

void RegisterAvatarCompare(CLI::App& avatar, Registry& registry) {
  const auto options = std::make_shared<stages::AvatarCompareOptions>();
  CLI::App* sub = avatar.add_subcommand(
      "compare", "Table of scored runs, methods x splits, as in Table 1 of the paper; runs of one method are its seeds");
  AddOption(sub, "run", options->runs, "folders of runs that `avatar eval` has scored; NAME=RUN gives the row's name")
      ->required();
  AddOptions(sub, *options);
  registry.Add(sub, "avatar compare", [options](CommandContext&) { return Describe(stages::RunAvatarCompare(*options)); });
}

}  // namespace mvstudio::cli
