#pragma once

#include "cli/program/command.h"

/// The subcommands of `calib`, a file each.
namespace mvstudio::cli {

void RegisterCalibConvert(CLI::App& calib, Registry& registry);
void RegisterCalibShow(CLI::App& calib, Registry& registry);
void RegisterCalibCompare(CLI::App& calib, Registry& registry);
void RegisterCalibEval(CLI::App& calib, Registry& registry);
void RegisterCalibRefine(CLI::App& calib, Registry& registry);
void RegisterCalibAlign(CLI::App& calib, Registry& registry);
void RegisterCalibClick(CLI::App& calib, Registry& registry);
void RegisterCalibResize(CLI::App& calib, Registry& registry);
void RegisterCalibLenses(CLI::App& calib, Registry& registry);

}  // namespace mvstudio::cli
