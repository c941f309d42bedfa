#pragma once

#include <string>

#include "avatar/body/mesh_raster.h"
#include "geometry/rig/rig.h"

/// Maps of DensePose (Güler et al., CVPR 2018), one PNG as large as the camera's image: part 0..24 and U, V times 255. Its
/// programs pass the array (I, U, V) to OpenCV, so I is the file's blue channel; files with I in red are detected by their
/// values.
namespace mvstudio::avatar {

/// FOLDER/CAMERA/NAME.png for an image NAME.jpg of the dataset.
std::string IuvPath(const std::string& folder, const std::string& camera, const std::string& image_path);

/// Labels in the crop's camera: those of the nearest pixel, background outside the image; depth is unknown. Throws IoError
/// / FormatError for files that are not such maps and for sizes other than the camera's.
body::PartUvMap ReadIuv(const std::string& path, const geometry::RigCamera& camera, const geometry::RigCamera& crop);

}  // namespace mvstudio::avatar
