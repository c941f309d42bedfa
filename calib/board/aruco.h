// Private: for apriltag.cc.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/board/apriltag.h"

/// Single ArUco markers as families of tags: the dictionaries of charuco_layout.h but for those that are AprilTag's.
namespace mvstudio::calib {

std::optional<TagFamily> FindArucoFamily(const std::string& name);
TagPattern ArucoPattern(const TagFamily& family, int id);
/// As FindTags; searched at twice the resolution where the image itself shows none.
std::vector<Tag> FindArucoTags(const TagFamily& family, const Image& grey);

}  // namespace mvstudio::calib
