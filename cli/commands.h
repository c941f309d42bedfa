#pragma once

#include "cli/command.h"

/// One function a command file; each adds its subcommands to `app` (Avatar*: to the subcommand `avatar`) and registers what
/// they run.
namespace mvstudio::cli {

void RegisterDemo(CLI::App& app, Registry& registry);
void RegisterSynth(CLI::App& app, Registry& registry);
void RegisterBoard(CLI::App& app, Registry& registry);
void RegisterCalibrate(CLI::App& app, Registry& registry);
void RegisterCalib(CLI::App& app, Registry& registry);
void RegisterTradeoff(CLI::App& app, Registry& registry);
void RegisterSync(CLI::App& app, Registry& registry);
void RegisterTriangulate(CLI::App& app, Registry& registry);
void RegisterDataset(CLI::App& app, Registry& registry);
void RegisterAvatarTrain(CLI::App& avatar, Registry& registry);
void RegisterAvatarEval(CLI::App& avatar, Registry& registry);
void RegisterMetrics(CLI::App& app, Registry& registry);
void RegisterReport(CLI::App& app, Registry& registry);
void RegisterVersion(CLI::App& app, Registry& registry);

}  // namespace mvstudio::cli
