#pragma once

#include <string>

#include "geometry/rig.h"

namespace mvstudio::geometry {

inline constexpr char kCalibrationSchema[] = "mvstudio.calibration/1";

/// The calibration file, JSON, see docs/formats.md. Numbers survive a round trip bit for bit. Throws IoError, or FormatError
/// with the place (`cameras[3].intrinsics.fx`).
Rig ReadRig(const std::string& path);
void WriteRig(const Rig& rig, const std::string& path);
Rig RigFromJsonText(const std::string& text, const std::string& path_for_messages);
std::string RigToJsonText(const Rig& rig);

}  // namespace mvstudio::geometry
