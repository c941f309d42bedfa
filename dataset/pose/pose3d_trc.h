#pragma once

#include <string>

#include "dataset/pose/pose3d.h"

namespace mvstudio::dataset {

/// Reads markers of a .trc file (Pose2Sim, OpenSim): y up, x_in_world = (z, x, y) of the file, units m or mm as in the
/// header. The file counts frames from 1, mvstudio from 0. Rows have status kOk or, where the file has no number,
/// kTooFewViews; no views, no sigma. `skeleton` stays empty: marker names may be anything. Throws IoError, or FormatError
/// with the line.
Pose3d ReadTrc(const std::string& path);

}  // namespace mvstudio::dataset
