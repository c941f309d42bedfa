#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "core/status.h"
#include "synth/cloth/surface_truth.h"
#include "synth/studio.h"

namespace mvstudio::synth {

struct SynthSummary {
  Status status = Status::kOk;  ///< otherwise the cloth gave no surface in `failed_frame`, and nothing was written
  int failed_frame = -1;
  int cameras = 0;
  int frames = 0;                               ///< of all takes, per camera
  int64_t pixels = 0;                           ///< rendered in all cameras, plates included
  std::vector<BeyondSkinning> beyond_skinning;  ///< by mesh, for a subject with cloth
  std::vector<std::string> files;               ///< main outputs, relative to the session
};

/// Records a session with its ground truth into `folder`, which appears only when it is complete (UsageError when it
/// exists, is not empty and `overwrite` is off). Layout: docs/synth.md. The same options and seed give the same bytes, for
/// any number of threads.
SynthSummary WriteSession(const SynthOptions& options, const std::string& folder, bool overwrite, const RunContext& run);

}  // namespace mvstudio::synth
