#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "dataset/pose/pose3d.h"
#include "dataset/pose/pose3d_compare.h"
#include "stages/result.h"

namespace mvstudio::stages {

struct TruthOptions {
  bool align = false;            ///< removes the best rigid motion first
  std::string marker_unit = {};  ///< of a file of markers, instead of what it states
};

struct TruthComparison {
  dataset::Pose3dComparison comparison;
  std::string unit = {}, up = {};       ///< of a file of markers: its unit of length, and "y" or "z"; else empty
  std::string unit_conflict = {};       ///< dataset::UnitDoubt
  std::vector<std::string> notes = {};  ///< MarkerFile::notes, with the path
};

/// Compares with `truth`: a folder of body3DScene files, or points as dataset::ReadPoints3d takes them.
/// Throws IoError, FormatError.
TruthComparison CompareWithTruth(const dataset::Pose3d& pose, const std::string& truth, const TruthOptions& options);

/// A comparison with nothing is none: it fails (kExitQualityGate). `option` gave `path`; `why`: Pose3dComparison::why_none.
Notice NothingInCommon(const std::string& option, const std::string& path, const std::string& why);

/// Figures of a comparison with nothing are null.
nlohmann::ordered_json ComparisonToJson(const TruthComparison& truth);

}  // namespace mvstudio::stages
