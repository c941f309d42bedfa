#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/image.h"
#include "geometry/lens/camera.h"

/// Single images of footage, small enough to lie inside a page.
namespace mvstudio::stages {

/// A part of a frame as a small JPEG: box (x, y, width, height) in pixels of the frame, from its top-left corner.
struct FrameImage {
  std::string jpeg;  ///< bytes of the file
  int x = 0, y = 0, width = 0, height = 0;
};

/// The part of the camera's frames around the points inside them, px, with a margin of an eighth of its longer side; all of it
/// without any such point.
FrameImage BoxAround(const std::vector<Eigen::Vector2d>& points_px, const geometry::Camera& camera);

/// At most `longer_side_px` and `most_bytes`: quality and then size are given up for the latter. Throws ContractViolation for
/// an empty box or one that leaves the frame.
FrameImage SmallImage(const Image& frame, FrameImage box, int longer_side_px, size_t most_bytes);
FrameImage SmallImage(const Image& frame, int longer_side_px, size_t most_bytes);

/// The last frame number that is worth reading of this footage: images cost nothing to skip, a video's frames are decoded one
/// after the other. The largest number where the footage cannot be listed.
int64_t LastCheapFrame(const std::string& footage_path);

/// Images of the frames with these numbers. Those that are missing or cannot be read are left out: never throws for what the
/// footage holds.
std::map<int64_t, Image> ReadFrames(const std::string& footage_path, std::set<int64_t> numbers);

/// Writes images[i] (bytes of a JPEG) as `folder`/names[i], in place of those of an earlier run; no folder is left where all
/// are empty. Returns their paths, empty ones for empty images. The caller holds the right to the folder.
std::vector<std::string> WriteImages(const std::vector<std::string>& images, const std::vector<std::string>& names,
                                     const std::string& folder);

}  // namespace mvstudio::stages
