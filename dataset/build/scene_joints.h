#pragma once

#include <map>
#include <string>

#include "dataset/pose/pose3d.h"

/// Joints that are a dataset's already: body3DScene_*.json files in place of points.
namespace mvstudio::dataset {

/// The body3DScene files by frame: of a dataset, or of the folder itself; empty where there are none. Throws FormatError for a
/// name without a frame number.
std::map<int, std::string> SceneFilesAt(const std::string& path);

/// Their joints as points of the coco19 skeleton in our world, with the frame rate of their time stamps. Throws IoError where
/// there is no file, FormatError as ReadBody3dScene.
Pose3d ReadSceneJoints(const std::string& path);

}  // namespace mvstudio::dataset
