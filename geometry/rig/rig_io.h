#pragma once

#include <string>

#include "geometry/rig/rig.h"

namespace mvstudio::geometry {

inline constexpr char kCalibrationSchema[] = "mvstudio.calibration/1";

/// Limit for the joint covariance in a file: 4.5 million numbers, about 100 MB of text. In memory it is dense, whatever
/// its size.
inline constexpr Eigen::Index kMaxJointUnknowns = 3000;

/// What a file of this rig omits from its covariance, and the consequence; empty: nothing.
std::string WhyJointCovarianceLeftOut(const Rig& rig);

/// Reads and writes the calibration file, JSON, see docs/formats.md. Numbers survive a round trip bit for bit. Throws
/// IoError, or FormatError with the place (`cameras[3].intrinsics.fx`).
Rig ReadRig(const std::string& path);
void WriteRig(const Rig& rig, const std::string& path);
Rig RigFromJsonText(const std::string& text, const std::string& path_for_messages);
std::string RigToJsonText(const Rig& rig);

}  // namespace mvstudio::geometry
