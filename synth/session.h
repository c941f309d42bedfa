#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "synth/studio.h"

namespace mvstudio::synth {

struct SynthSummary {
  int cameras = 0;
  int frames = 0;                  ///< of all takes, per camera
  int64_t pixels = 0;              ///< rendered in all cameras, plates included
  std::vector<std::string> files;  ///< main outputs, relative to the session
};

/// Records a session with its ground truth into `folder`, which appears only when it is complete (UsageError when it
/// exists, is not empty and `overwrite` is off). Layout: docs/synth.md. The same options and seed give the same bytes, for
/// any number of threads.
SynthSummary WriteSession(const SynthOptions& options, const std::string& folder, bool overwrite, const RunContext& run);

}  // namespace mvstudio::synth
