#include "cli/tradeoff/tradeoff.h"

#include "cli/program/commands.h"
#include "cli/program/options.h"

namespace mvstudio::cli {

void RegisterTradeoff(CLI::App& app, Registry& registry) {
  CLI::App* tradeoff = app.add_subcommand("tradeoff", "Measure what speed costs in accuracy");
  tradeoff->require_subcommand(1);
  RegisterTradeoffCalibrate(*tradeoff, registry);
  RegisterTradeoffTriangulate(*tradeoff, registry);
  RegisterTradeoffPack(*tradeoff, registry);
}

}  // namespace mvstudio::cli
