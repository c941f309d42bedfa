#pragma once

#include <string>

#include "body/mesh_raster.h"
#include "geometry/rig/rig.h"

/// Maps of DensePose (Güler et al., CVPR 2018), one PNG as large as the camera's picture: part 0..24 and U, V times 255. Its
/// programs hand the array (I, U, V) to OpenCV, so that I is the file's blue channel; files with I in red are known by their
/// values.
namespace mvstudio::avatar {

/// FOLDER/CAMERA/NAME.png for a picture NAME.jpg of the dataset.
std::string IuvPath(const std::string& folder, const std::string& camera, const std::string& picture_path);

/// Labels as the crop's camera sees them: those of the nearest pixel, background where the picture ends; depth is not known.
/// Throws IoError / FormatError for files that are no such map and for sizes other than the camera's.
body::PartUvMap ReadIuv(const std::string& path, const geometry::RigCamera& camera, const geometry::RigCamera& crop);

}  // namespace mvstudio::avatar
