#pragma once

#include <optional>
#include <string>

#include "calib/keypoints/place.h"
#include "calib/keypoints/refine.h"
#include "calib/points/stated_length.h"
#include "core/progress.h"
#include "stages/input_notes.h"
#include "stages/refine/options.h"
#include "triangulate/take/cause.h"

namespace mvstudio::stages {

struct RefineReport {
  RefineOptions options;
  InputNotes notes;
  geometry::Skeleton skeleton;
  size_t num_not_adjusted = 0;             ///< cameras without 2D points
  size_t num_not_placed = 0;               ///< the same of lenses without poses: they are not in the rig
  bool by_height = false;                  ///< `placed` has its size by a person's height
  std::optional<calib::PlacedRig> placed;  ///< of lenses without poses: before the adjustment
  calib::KeypointRefineReport refined;

  triangulate::CauseTrial fit;                     ///< of the adjusted rig
  triangulate::CauseReport timing;                 ///< for the adjusted rig, where detections fit it
  std::optional<triangulate::CauseReport> causes;  ///< where less than half of the take fits the given rig
  std::optional<calib::LengthScale> scale;         ///< where lengths are stated

  geometry::Rig written;
  std::string path;  ///< of calibration.json; empty: nothing was solved, and it is not written

  bool Placed() const { return !placed || placed->status == Status::kOk; }
  double PersonHeightM() const { return options.person_height_m > 0 ? options.person_height_m : 1.7; }
};

/// Adjusts a rig to 2D points of several cameras and writes calibration.json: the adjusted rig, or the given one when nothing
/// explains held-out frames better. Throws UsageError, IoError and FormatError; points that determine no rig are no error (the
/// statuses of `placed`, `refined` and `scale`).
RefineReport RunRefine(RefineOptions options, const RunContext& run = {});

}  // namespace mvstudio::stages
