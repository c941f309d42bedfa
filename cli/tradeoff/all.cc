#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/stage.h"
#include "stages/fronts/run.h"

namespace mvstudio::cli {

void RegisterTradeoffAll(CLI::App& tradeoff, Registry& registry) {
  const auto options = std::make_shared<stages::FrontsOptions>();
  CLI::App* sub = tradeoff.add_subcommand(
      "all", "Calibration, keypoints, masks, triangulation, packs and avatars: time, memory and held-out error on one page");
  AddOutput(sub, "--out", options->out, OutputKind::kFile,
            "the page; its results go beside it as .json, what the ways write into .runs, which is removed again")
      ->required();
  AddOptions(sub, *options);
  registry.Add(sub, "tradeoff all", [options](CommandContext& context) {
    return Describe(RunFronts(*options, ChildCallsIn(context), context.run));
  });
}

}  // namespace mvstudio::cli
