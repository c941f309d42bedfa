#pragma once

#include <string>
#include <vector>

#include "app/nets/pose2d_detect.h"

namespace mvstudio::app {

/// Frames of the footage as its container or folder counts them; 0 when unknown.
int FramesOf(const dataset::CameraFootage& footage);

/// Key points that another tool has written: FOLDER/CAMERA of the footage's cameras, or of all sub-folders when there is no
/// footage. Joints whose score is not above 0, or that lie outside the picture by more than its size, are not detected; scores
/// above 1 count as 1.
/// Files that cannot be read are listed as damage. Throws as dataset::ReadOpenPoseFolder, UsageError for a missing folder.
std::vector<CameraPoses> ReadExistingPoses(const std::string& folder, const std::vector<dataset::CameraFootage>& footage,
                                           const body::Skeleton& skeleton, CommandResult* result);

}  // namespace mvstudio::app
