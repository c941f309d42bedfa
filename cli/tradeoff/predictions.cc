#include "stages/tradeoff/predictions.h"

#include "cli/program/commands.h"
#include "cli/program/options.h"

namespace mvstudio::cli {

void RegisterTradeoffPredictions(CLI::App& tradeoff, Registry& registry) {
  const auto options = std::make_shared<stages::PredictionsOptions>();
  CLI::App* sub = tradeoff.add_subcommand("predictions", "What budgets predicted in earlier runs, and what came of it");
  AddOption(sub, "files", options->files, "files predictions.jsonl, or folders that are searched for them")->required();
  AddOutput(sub, "--out", options->out, OutputKind::kFolder, "folder for the page with the figures");
  registry.Add(sub, "tradeoff predictions", [options](CommandContext&) { return Describe(stages::RunPredictions(*options)); });
}

}  // namespace mvstudio::cli
