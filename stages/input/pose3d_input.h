#pragma once

#include <map>
#include <string>

#include "dataset/pose/pose3d.h"

namespace mvstudio::stages {

/// 3D joints as Panoptic's 19, frame -> person -> pose, in any form: points as dataset::ReadPoints3d takes them
/// (`marker_unit` replaces a file's unit; empty: its own), a dataset, or a folder of body3DScene files. Throws IoError for
/// another path; FormatError, also where none of the joints gives one of the 19, or where a file's name has no frame number.
std::map<int, std::map<int, dataset::Coco19Pose>> ReadCoco19Poses(const std::string& path, const std::string& marker_unit = {});

/// The people of the body3DScene_%08d.json files of a folder or dataset, by frame. Throws FormatError, IoError.
std::map<int, std::map<int, dataset::Coco19Pose>> ReadSceneFiles(const std::string& folder);

}  // namespace mvstudio::stages
