#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"

namespace mvstudio::dataset {

/// Two cameras whose images are each other's.
struct ExchangedCameras {
  std::string a, b;
  double times_a = 0,
         times_b = 0;  ///< how much more of what moves in the images of a (b) lies on the joints as b (a) sees them
  int frames = 0;

  /// In a sentence; `name_a`, `name_b`: what the cameras are called.
  std::string Text(const std::string& name_a, const std::string& name_b) const;
};

/// Looks for footage of two cameras that was exchanged, by what moves: how far an image is from its camera's median, at the
/// joints as each camera sees them, over its mean. Two cameras count where both images fit the other's joints better, together
/// by a quarter, in four of five of up to 24 frames (5 at least) and by four standard errors. Recordings in their right order
/// stay below: there the own joints fit better. People who stand still, cameras beside each other and images of different
/// sizes say nothing. `image`: path of a camera's image of a frame, which may be missing; damaged ones are left out.
std::vector<ExchangedCameras> FindExchanged(const geometry::Rig& rig, const std::map<int, std::map<int, Coco19Pose>>& poses,
                                            const std::function<std::string(const std::string& camera, int frame)>& image,
                                            const RunContext& run);

}  // namespace mvstudio::dataset
