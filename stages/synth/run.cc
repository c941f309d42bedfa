#include "stages/synth/run.h"

#include <chrono>

namespace mvstudio::stages {

SynthReport RunSynth(const SynthSessionOptions& options, const RunContext& run) {
  const auto start = std::chrono::steady_clock::now();
  SynthReport report;
  report.options = options;
  report.summary = synth::WriteSession(options.studio, options.out, options.overwrite, run);
  report.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace mvstudio::stages
