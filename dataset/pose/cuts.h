#pragma once

#include <map>
#include <vector>

#include "dataset/pose/pose3d.h"

/// Hard cuts: places where one clip follows another and a person is suddenly elsewhere. Nothing may be carried across.
namespace mvstudio::dataset {

/// True when nobody moves from `a` to `b` in `frames` frames: the body centre (or, where it is not known in both, the mean
/// of the joints known in both) is displaced by more than 0.5 m + 3 m/s. A frame counts as 1/29.97 s. False when no joint
/// is known in both.
bool IsCut(const Coco19Pose& a, const Coco19Pose& b, int frames);

/// Frames at which another clip begins, ascending. `poses`: one person, by frame.
std::vector<int> FindCuts(const std::map<int, Coco19Pose>& poses);

}  // namespace mvstudio::dataset
