// Private: nlohmann's JSON, for the readers of Panoptic's calibrations.
#pragma once

#include <string>

#include "dataset/json/json_file.h"
#include "dataset/panoptic/panoptic_files.h"

namespace mvstudio::dataset::internal {

/// One entry of "cameras", unchanged. Throws FormatError.
PanopticCamera ReadPanopticCameraFields(const JsonView& json);

/// The same camera in our world. `where` is its place in the file; `drift` receives the distance of R from the nearest
/// rotation.
geometry::RigCamera ToRigCamera(const PanopticCamera& camera, const std::string& path, const std::string& where, double* drift);

}  // namespace mvstudio::dataset::internal
