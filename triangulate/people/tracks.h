#pragma once

#include <vector>

#include "triangulate/people/association.h"

namespace mvstudio::triangulate {

/// The people found in one frame.
struct TrackFrame {
  int frame = 0;
  std::vector<Cluster> clusters;
};

/// Gives clusters person numbers that persist over frames.
///
/// In each frame the clusters are assigned to the tracks so that the sum of (1 - distance / gate) is largest. The distance
/// is the median over the joints from the track's prediction: its last joints moved by its mean velocity over the last
/// five frames. The gate is max_step_m times the square root of the frames since then. Chance matches are removed
/// (ghosts.h).
///
/// A track continues an earlier or later person (who left and came back) when both never appear together and it is seen at
/// least half as well. It takes the person with the shortest way, if that can be walked with max_step_m per frame.
/// Otherwise it is a new person or, when there are max_persons already, the best supported person that it can continue (a
/// cut). Persons are numbered by support.
TakeAssociation FollowPersons(const PreparedRig& rig, const std::vector<TrackFrame>& frames, const AssociationOptions& options);

}  // namespace mvstudio::triangulate
