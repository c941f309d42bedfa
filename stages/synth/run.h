#pragma once

#include "core/progress.h"
#include "stages/synth/options.h"

namespace mvstudio::stages {

struct SynthReport {
  SynthSessionOptions options;
  synth::SynthSummary summary;  ///< its status tells whether anything was written
  double wall_s = 0;
};

/// Renders the studio and writes its session. Throws UsageError, IoError.
SynthReport RunSynth(const SynthSessionOptions& options, const RunContext& run = {});

}  // namespace mvstudio::stages
