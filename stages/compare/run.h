#pragma once

#include <string>
#include <vector>

#include "calib/check/expected_difference.h"
#include "calib/check/rig_compare.h"
#include "geometry/rig/alignment.h"
#include "stages/compare/options.h"
#include "stages/input_notes.h"

namespace mvstudio::stages {

/// One camera's lenses, whatever its poses.
struct ComparedLenses {
  std::string camera;
  calib::ProjectionDiff diff;
  std::vector<double> expected_px;  ///< calib::ExpectedProjectionRms, of each range
};

struct CompareReport {
  CompareOptions options;
  InputNotes notes;
  std::vector<std::string> only_in_rig, only_in_reference;  ///< cameras that were left out
  std::vector<std::string> cameras;                         ///< that are in both, in the reference's order
  geometry::RigDifference difference;
  std::vector<calib::PoseDifference> poses, expected_poses;  ///< of `cameras`; empty for one alone, and unless aligned
  std::vector<ComparedLenses> lenses;                        ///< of `cameras`; empty unless aligned

  bool IsAlone() const { return cameras.size() == 1; }
};

/// Compares the cameras that are in both. Throws UsageError, IoError and FormatError; rigs that cannot be aligned are no error
/// (RigDifference::status). Writes nothing.
CompareReport RunCompare(const CompareOptions& options);

}  // namespace mvstudio::stages
