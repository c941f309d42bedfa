// Private: parts of scene.cc.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "stages/view/scene.h"

namespace mvstudio::stages {

/// Whether `path`, links followed, lies in `folder`. It need not exist.
bool LiesIn(const std::string& path, const std::string& folder);

/// Throws UsageError for a path that leads outside of `folder`; an empty folder holds everything.
void RequireInside(const std::string& path, const std::string& folder);

/// Images that were held out from the training of the avatar in a folder; none where it was not scored.
void ReadHeldOut(const std::string& folder, Scene* scene);

/// The frames of footage, ascending; a video's are counted without decoding.
std::vector<int64_t> FrameNumbersOf(const std::string& footage);

/// Joints, and how well they fit, in place of what the scene has.
void UsePose3d(const dataset::Pose3d& pose, Scene* scene);
void UseCoco19(const std::map<int, std::map<int, dataset::Coco19Pose>>& poses, Scene* scene);

/// Cameras that look at all joints from the front (-y), the person's left (+x) and above, from so far that they hardly
/// converge.
void AddPlainCameras(Scene* scene);

}  // namespace mvstudio::stages
