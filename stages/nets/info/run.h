#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "avatar/settings/options.h"

/// The size of a network.
namespace mvstudio::stages {

struct NetworkInfo {
  std::string run;  ///< folder of a trained one; empty: of what was asked for
  avatar::ModelOptions model;
  int64_t num_parameters = 0, num_texels = 0;
  std::optional<int64_t> step;  ///< of a run
  int size_px = 0;
};

/// `run`: empty, or a run whose network is described in place of `asked`. Throws UsageError for a run of Gaussians, and for
/// options that contradict each other; IoError, FormatError.
NetworkInfo InfoOfNetwork(const std::string& run, const avatar::ModelOptions& asked);

}  // namespace mvstudio::stages
