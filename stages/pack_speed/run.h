#pragma once

#include <string>
#include <vector>

#include "stages/pack_speed/measure.h"
#include "stages/result.h"

/// `tradeoff pack`: what each way of reading crops costs and buys.
namespace mvstudio::stages {

struct PackTradeoffOptions {
  std::string folder, out;                                     ///< of the dataset, of the page
  std::vector<std::string> crops{"96", "128", "256", "full"};  ///< px
  PackSpeedOptions how;                                        ///< its crops and its work folder are set by the run
};

struct PackTradeoffReport {
  std::string folder, out, page;
  PackSpeedReport speed;
  std::vector<bool>
      on_front;  ///< of each trial: no other of the same crop size and threads is faster, smaller and nearer at once
};

/// Measures, and writes the page with the figures. Throws UsageError for a crop size that is none, and what reading datasets
/// throws.
PackTradeoffReport RunPackTradeoff(const PackTradeoffOptions& options, const RunContext& run = {});

CommandResult Describe(const PackTradeoffReport& report);

}  // namespace mvstudio::stages
