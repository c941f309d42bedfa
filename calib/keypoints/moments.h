#pragma once

#include <string>
#include <vector>

#include "calib/keypoints/place.h"
#include "calib/keypoints/refine.h"
#include "calib/points/scene_points.h"
#include "calib/points/stated_length.h"

namespace mvstudio::calib {

/// The points of a take by their names, of every frame and person, in order of time. Of more than 2000 frames, that many,
/// evenly spread. `joints`: names by index.
std::vector<NamedPoints> MomentsOf(const geometry::Rig& rig, const std::vector<triangulate::DetectedFrame>& frames,
                                   const std::vector<std::string>& joints, const KeypointRefineOptions& options);

/// Points that were marked in two cameras of the rig or more. Throws UsageError for a camera that the rig lacks.
NamedPoints PointsOfMarks(const geometry::Rig& rig, const ScenePoints& marks);

/// Stated lengths of joints as PlaceFromKeypoints takes them; `lengths` as of LengthsOf.
std::vector<KnownLength> KnownLengthsOf(const std::vector<StatedLength>& lengths, const std::vector<std::string>& joints);

}  // namespace mvstudio::calib
