#pragma once

#include "cli/command.h"
#include "dataset/verify/verify.h"

namespace mvstudio::cli {

/// `dataset verify` and `dataset info`, for folders in Panoptic layout and for packs.
void RegisterDatasetCheck(CLI::App& dataset, Registry& registry);

/// Adds findings to a result: metrics.findings, its errors and warnings, a line of text each.
void AddFindings(const std::vector<dataset::Finding>& findings, CommandResult* result);

}  // namespace mvstudio::cli
