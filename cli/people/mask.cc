#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/nets/mask/describe.h"

namespace mvstudio::cli {

void RegisterMask(CLI::App& app, Registry& registry) {
  const auto options = std::make_shared<stages::MaskStageOptions>();
  CLI::App* sub = app.add_subcommand("mask", "Foreground masks of people, with their quality");
  AddOptions(sub, *options);
  registry.Add(sub, "mask", [options, sub](CommandContext& context) {
    options->given = GivenOptions(sub);
    return options->part.empty() ? Describe(stages::RunMask(*options, context.run))
                                 : Describe(stages::RunMaskPart(*options, context.run));
  });
}

}  // namespace mvstudio::cli
