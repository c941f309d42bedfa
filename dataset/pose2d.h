#pragma once

#include <map>
#include <string>
#include <vector>

#include "body/skeleton.h"

namespace mvstudio::dataset {

struct Keypoint2d {
  double x_px = 0, y_px = 0;
  double score = 0;  ///< 0: not detected
};

/// One person's key points in one image, in the order of the skeleton.
struct Person2d {
  std::vector<Keypoint2d> keypoints;
};

/// Detections of one camera: frame number -> people in that image (possibly none).
struct Pose2dTrack {
  std::string camera;
  std::map<int, std::vector<Person2d>> frames;
};

/// Reads a folder of OpenPose JSON files (`*.json`, one a frame). The frame number is the last run of digits in the file name
/// before
/// `_keypoints` or the extension. Throws IoError for a missing or empty folder, FormatError (path, place) for truncated JSON or
/// a key-point count that does not fit the skeleton (with the skeleton that would fit).
Pose2dTrack ReadOpenPoseFolder(const std::string& folder, const std::string& camera, const body::Skeleton& skeleton);

/// Writes one file a frame, `%012d_keypoints.json`, OpenPose 1.3 layout.
void WriteOpenPoseFolder(const Pose2dTrack& track, const std::string& folder);

}  // namespace mvstudio::dataset
