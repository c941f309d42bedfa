#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "dataset/pose/pose3d.h"
#include "dataset/pose/pose3d_compare.h"

namespace mvstudio::app {

/// Compares with `truth`: a folder of body3DScene files, a folder with points.csv, or a single table. Throws IoError,
/// FormatError.
dataset::Pose3dComparison CompareWithTruth(const dataset::Pose3d& pose, const std::string& truth, bool align);

nlohmann::ordered_json ComparisonToJson(const dataset::Pose3dComparison& comparison);

}  // namespace mvstudio::app
