// Private: the formats of WriteCalibration, one writer each.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/formats/formats.h"
#include "geometry/lens/camera.h"
#include "geometry/rig/rig.h"

namespace mvstudio::calib::internal {

// Every lens is supported and translations are in metres_per_unit. They return the files they wrote.
using Files = std::vector<std::string>;
Files WriteToml(const geometry::Rig& rig, const std::string& path, bool nested);
Files WriteQca(const geometry::Rig& rig, const std::string& path, double distortion_divisor);
/// Note about the divisor, see ReadQca; empty where no lens has distortion.
std::optional<Notice> QcaDivisorNote(const geometry::Rig& rig, double divisor, bool writing);
Files WriteOpenCvYaml(const geometry::Rig& rig, const std::string& path);
Files WriteEasyMocap(const geometry::Rig& rig, const std::string& path);
Files WriteMrcal(const geometry::Rig& rig, const std::string& path);
Files WriteColmap(const geometry::Rig& rig, const std::string& path, bool text);
Files WriteNerfstudio(const geometry::Rig& rig, const std::string& path);
Files WriteKalibr(const geometry::Rig& rig, const std::string& path);

// Whether the format supports this lens.
bool ColmapCanCarry(const geometry::Camera& camera);
bool MrcalCanCarry(const geometry::Camera& camera);
bool NerfstudioCanCarry(const geometry::Camera& camera);
bool KalibrCanCarry(const geometry::Camera& camera);

}  // namespace mvstudio::calib::internal
