#pragma once

#include <string>
#include <vector>

#include "stages/nets/pose2d/detect.h"

namespace mvstudio::stages {

/// Number of frames of the footage according to its container or folder; 0 when unknown.
int FramesOf(const dataset::CameraFootage& footage);

/// Reads keypoints written by another tool: FOLDER/CAMERA of the footage's cameras, or of all sub-folders when there is no
/// footage. Joints whose score is not above 0, or that lie outside the image by more than its size, are not detected;
/// scores above 1 count as 1. Unreadable files are listed as damage. Throws like dataset::ReadOpenPoseFolder, UsageError
/// for a missing folder.
std::vector<CameraPoses> ReadExistingPoses(const std::string& folder, const std::vector<dataset::CameraFootage>& footage,
                                           const geometry::Skeleton& skeleton, InputNotes* notes);

}  // namespace mvstudio::stages
