#pragma once

#include "cli/program/command.h"

/// The subcommands of `tradeoff`, a file each.
namespace mvstudio::cli {

void RegisterTradeoffCalibrate(CLI::App& tradeoff, Registry& registry);
void RegisterTradeoffTriangulate(CLI::App& tradeoff, Registry& registry);
void RegisterTradeoffPack(CLI::App& tradeoff, Registry& registry);

}  // namespace mvstudio::cli
