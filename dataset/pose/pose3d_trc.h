#pragma once

#include <string>

#include "dataset/pose/markers.h"
#include "dataset/pose/pose3d.h"

namespace mvstudio::dataset {

/// Reads markers of a .trc file (OpenSim, Pose2Sim, OpenCap, Theia): y up, x_in_world = (z, x, y) of the file, unit as in the
/// header (m, cm, mm, in). The file counts frames from 1, mvstudio from 0. Rows have status kOk or, where the file has no
/// number, kTooFewViews; no views, no sigma. The skeleton is "points": marker names may be anything. `unit`: as in
/// ReadMarkers. Throws IoError, or FormatError with the line.
MarkerFile ReadTrcMarkers(const std::string& path, const std::string& unit = {});
Pose3d ReadTrc(const std::string& path);

}  // namespace mvstudio::dataset
