#pragma once

#include "core/progress.h"
#include "stages/triangulate/options.h"
#include "stages/triangulate/report.h"

namespace mvstudio::stages {

/// 3D joints of a take, written as points.csv, covariance.csv and pose3d.json with what else the options ask for. Throws
/// UsageError, IoError and FormatError; a take of which nothing fits is no error (TriangulateReport::loss, limbs,
/// inconsistency).
TriangulateReport RunTriangulate(TriangulateOptions options, const RunContext& run = {});

}  // namespace mvstudio::stages
