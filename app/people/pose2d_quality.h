#pragma once

#include <string>
#include <vector>

#include "app/result.h"
#include "body/skeleton.h"
#include "core/progress.h"
#include "dataset/pose/pose2d.h"
#include "geometry/rig/rig.h"

/// How well the key points of several cameras agree.
namespace mvstudio::app {

struct PoseAgreement {
  double median_px = 0, p90_px = 0;  ///< distance of a detection from what the other cameras say, over all of them; infinite
                                     ///< where they say nothing. NaN: there was nothing to compare
  double share_ok = 0;               ///< of the joints of people, those that were triangulated
  double sigma_px = 0;               ///< noise of the detections
  int sides_fixed = 0;               ///< detections whose left and right were swapped
  nlohmann::ordered_json json;       ///< the same and by camera and joint, for the result
};

/// Triangulates and leaves one camera out after the other. Tracks of cameras that the rig does not have are left out.
PoseAgreement MeasureAgreement(const std::vector<dataset::Pose2dTrack>& tracks, const body::Skeleton& skeleton,
                               const geometry::Rig& rig, int max_persons, const RunContext& run);

}  // namespace mvstudio::app
