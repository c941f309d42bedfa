#pragma once

#include <vector>

#include "triangulate/people/association.h"

namespace mvstudio::triangulate {

/// How well a chain of clusters is attested.
struct TrackSupport {
  int num_frames = 0;      ///< that have a cluster
  double num_views = 0;    ///< cameras that show it, mean over these frames
  double num_chances = 0;  ///< cameras whose image contains the middle of its joints, mean over these frames
};

/// Cameras whose image contains the middle (median) of the cluster's joints.
int CountChances(const PreparedRig& rig, const Cluster& cluster);

/// Which tracks come from chance matches of false or foreign detections: no more than 2.5 views on average, and
/// - seen by less than half as large a part of the cameras that look at them as the best track (`tracks` are sorted, it is the
///   first), so that a person whom only two cameras can see is none; or
/// - in one or two frames of a take of ten or more.
/// A chance match needs two detections that happen to lie in one epipolar plane with all their joints; a third view almost
/// never joins it.
std::vector<bool> FindGhosts(const std::vector<TrackSupport>& tracks, int num_frames);

}  // namespace mvstudio::triangulate
