#pragma once

#include <string>
#include <vector>

#include "dataset/pose/pose2d.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"
#include "geometry/skeleton/skeleton.h"
#include "triangulate/take/take.h"

/// Converts between the files of dataset/ and the arrays of triangulate/.
namespace mvstudio::stages {

/// One entry for each frame of `range` that any camera has. Throws FormatError (naming `calib_path`, the track's camera and
/// both lists) when a track's camera is not in the rig.
std::vector<triangulate::DetectedFrame> ToFrames(const std::vector<dataset::Pose2dTrack>& tracks, const geometry::Rig& rig,
                                                 const std::string& calib_path, const dataset::FrameRange& range = {});

dataset::Pose3d ToPose3d(const triangulate::TakeResult& take, const geometry::Skeleton& skeleton);

}  // namespace mvstudio::stages
