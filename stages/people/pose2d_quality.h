#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "dataset/pose/pose2d.h"
#include "geometry/rig/rig.h"
#include "geometry/skeleton/skeleton.h"
#include "triangulate/take/take.h"

/// Agreement between the keypoints of several cameras.
namespace mvstudio::stages {

struct PoseAgreement {
  bool measured = false;             ///< at least two cameras could be compared
  double median_px = 0, p90_px = 0;  ///< distance of a detection from the prediction by the other cameras, over all
                                     ///< detections; infinite where there is no prediction. NaN: nothing to compare
  double share_ok = 0;               ///< fraction of the joints of people that were triangulated
  double sigma_px = 0;               ///< noise of the detections
  int sides_fixed = 0;               ///< detections whose left and right were swapped
  triangulate::TakeMethod method;
  triangulate::LeftOutFigures all;

  struct OfCamera {
    std::string name;
    triangulate::LeftOutFigures figures;
  };
  struct OfJoint {
    std::string name;
    double share_ok = 0;
    std::optional<triangulate::LeftOutFigures> figures;
  };
  std::vector<OfCamera> cameras;  ///< those with detections to compare
  std::vector<OfJoint> joints;    ///< of the skeleton
};

/// Triangulates with each camera left out in turn. Tracks of cameras that the rig lacks are ignored.
PoseAgreement MeasureAgreement(const std::vector<dataset::Pose2dTrack>& tracks, const geometry::Skeleton& skeleton,
                               const geometry::Rig& rig, int max_persons, const RunContext& run);

}  // namespace mvstudio::stages
