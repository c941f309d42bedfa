#pragma once

#include <vector>

#include "triangulate/people/association.h"

namespace mvstudio::triangulate {

/// Support of a chain of clusters.
struct TrackSupport {
  int num_frames = 0;      ///< that have a cluster
  double num_views = 0;    ///< cameras that show it, mean over these frames
  double num_chances = 0;  ///< cameras whose image contains the middle of its joints, mean over these frames
};

/// Number of cameras whose image contains the middle (median) of the cluster's joints.
int CountChances(const PreparedRig& rig, const Cluster& cluster);

/// Finds tracks made of chance matches of false or unrelated detections. They have at most 2.5 views on average, and
///   - are seen by less than half the fraction of the cameras facing them that sees the best track (`tracks` are
///     sorted, it is the first), so that a person whom only two cameras can see is kept; or
///   - occur in only one or two frames of a take of ten or more.
///
/// A chance match needs two detections with all joints in one epipolar plane; a third view almost never joins it.
std::vector<bool> FindGhosts(const std::vector<TrackSupport>& tracks, int num_frames);

}  // namespace mvstudio::triangulate
