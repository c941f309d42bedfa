#pragma once

#include <optional>

#include "calib/check/seen_corners.h"
#include "calib/points/align_rig.h"
#include "calib/points/stated_length.h"
#include "core/progress.h"
#include "stages/align/options.h"
#include "stages/input_notes.h"
#include "stages/people/feet_floor.h"

namespace mvstudio::stages {

struct AlignReport {
  AlignOptions options;  ///< as the session settled them
  InputNotes notes;
  CornerInput corners;                        ///< of a board on the floor
  calib::CornerFindings found;                ///< what was put right about them
  std::optional<FeetFloor> floor;             ///< under people's feet
  std::optional<calib::LengthScale> lengths;  ///< where they are stated
  calib::RigAlignment aligned;

  bool HasFloor() const { return options.points.empty(); }
};

/// Moves a calibration to the world of a board on the floor, of the floor under people's feet or of points, or gives it its
/// size by lengths, and writes it. Throws UsageError, IoError and FormatError; what determines no world is no error
/// (RigAlignment::status), and then nothing is written.
AlignReport RunAlign(AlignOptions options, const RunContext& run = {});

}  // namespace mvstudio::stages
