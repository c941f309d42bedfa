#pragma once

#include "calib/check/rig_check.h"
#include "core/progress.h"
#include "geometry/rig/rig.h"
#include "stages/eval/options.h"
#include "stages/input_notes.h"

namespace mvstudio::stages {

struct EvalReport {
  EvalOptions options;  ///< as the session settled them
  InputNotes notes;
  geometry::Rig rig;  ///< as it was read
  CornerInput corners;
  calib::RigCheck check;

  /// A new calibration was asked for, and some camera has a new pose.
  bool Repaired() const { return !options.repair.empty() && check.status == Status::kOk && !check.moved.empty(); }
};

/// Checks a calibration on new boards; writes the repaired one where that is asked for and a camera has moved. Throws
/// UsageError, IoError and FormatError; corners that say nothing are no error (RigCheck::status).
EvalReport RunEval(EvalOptions options, const RunContext& run = {});

}  // namespace mvstudio::stages
