#pragma once

#include <memory>
#include <optional>

#include "core/progress.h"
#include "dataset/time/timeline.h"
#include "stages/calib/calibration_use.h"
#include "stages/input/pose_input.h"
#include "stages/input/session_input.h"
#include "stages/triangulate/options.h"

namespace mvstudio::stages {

/// How frames of all cameras were made to belong together.
struct TakeTiming {
  /// Their numbers lead back to the footage, as they are or by the timeline; false: frames lie between those of the footage.
  bool in_footage = true;
  std::shared_ptr<const dataset::Timeline> timeline;  ///< null: the numbers are those of the footage
  std::optional<OffsetUse> offsets;                   ///< of a calibration that states some
};

/// By what the take states, else by what the calibration does.
TakeTiming ApplyTiming(const std::optional<FoundTake>& found, const TriangulateOptions& options, const RunContext& run,
                       PoseInput* input, InputNotes* notes);

}  // namespace mvstudio::stages
