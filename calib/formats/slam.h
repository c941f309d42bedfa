// Private: for opencv.cc and formats.cc.
#pragma once

#include <string>
#include <vector>

#include "calib/formats/formats.h"
#include "calib/formats/opencv_yaml.h"

/// Cameras of programs for visual odometry, whose files are OpenCV's storage without its camera matrices, or Basalt's JSON.
namespace mvstudio::calib::internal {

/// camodocal's lens files (`model_type`), which VINS-Mono and VINS-Fusion take, and their settings.
bool IsVins(const Entries& entries);
/// Lenses of one file each; with `body_T_camN` or `extrinsicRotation` of the settings their poses, and the body is the world.
/// PINHOLE, PINHOLE_FULL, KANNALA_BRANDT, and MEI without k1 and k2. Throws FormatError for others, by name.
ImportedRig ReadVins(const std::vector<std::string>& paths, const std::vector<Entries>& files, const ReadOptions& options);

/// Settings of ORB-SLAM2 and 3: `Camera.fx` or `Camera1.fx`.
bool IsOrbSlam(const Entries& entries);
/// PinHole, KannalaBrandt8 and Rectified; of two cameras the first is the world. Throws FormatError.
ImportedRig ReadOrbSlam(const std::string& path, const Entries& entries, const ReadOptions& options);

/// Basalt's calibration.json: ds, eucm, ucm, kb4, pinhole, pinhole-radtan8; the IMU is the world. Throws FormatError.
ImportedRig ReadBasalt(const std::string& path, const ReadOptions& options);

}  // namespace mvstudio::calib::internal
