// Private: what BuildCamera learns of footage before it writes images.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "dataset/build/build_blocks.h"
#include "dataset/build/build_camera.h"

namespace mvstudio::dataset::internal {

/// The time steps of a frame of the footage.
class TimeSteps {
 public:
  /// Throws FormatError for a camera that the timeline does not name.
  explicit TimeSteps(const CameraFootage& footage);
  std::vector<int> Of(int64_t number) const;
  /// Those of `wanted` that the camera has no frame for, as the timeline tells.
  std::set<int> WithoutFrame(const std::set<int>& wanted) const;

 private:
  bool known_ = false;
  std::map<int64_t, std::vector<int>> of_;
};

/// "640x480"
std::string PixelsText(int width, int height);

/// Frames to learn the background from: evenly spaced among those with joints.
std::set<int> SampleFrames(const std::map<int, People>& poses, int count);

/// First pass over the footage: all of it must decode, have one size and reach the last frame of the joints.
FootageSamples ReadSamples(const CameraJob& job, const std::set<int>& wanted, const BuildOptions& options);

}  // namespace mvstudio::dataset::internal
