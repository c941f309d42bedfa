#include "stages/synth/run.h"

#include "core/stopwatch.h"

namespace mvstudio::stages {

SynthReport RunSynth(const SynthSessionOptions& options, const RunContext& run) {
  const Stopwatch watch;
  SynthReport report;
  report.options = options;
  report.summary = synth::WriteSession(options.studio, options.out, options.overwrite, run);
  report.wall_s = watch.Seconds();
  return report;
}

}  // namespace mvstudio::stages
