#pragma once

#include <vector>

#include "triangulate/people/association.h"

namespace mvstudio::triangulate {

/// The people found in one frame.
struct TrackFrame {
  int frame = 0;
  std::vector<Cluster> clusters;
};

/// Gives clusters person numbers that last over frames.
///
/// In each frame the clusters are assigned to the tracks so that the sum of (1 - distance / gate) is largest: distance is the
/// median over the joints from where the track is expected, its last joints moved on with its mean velocity over the last five
/// frames; the gate is max_step_m, growing with the square root of the frames since. Chance matches are dropped (ghosts.h).
///
/// A track continues an earlier or later person (who left and came back) when both never appear together and it is seen at
/// least half as well: the person whom the shortest way would have to take it to, if it can be walked with max_step_m a frame;
/// otherwise it is a new person or, when there are max_persons already, the best supported that it can continue (a cut).
/// Persons are numbered by support.
TakeAssociation FollowPersons(const PreparedRig& rig, const std::vector<TrackFrame>& frames, const AssociationOptions& options);

}  // namespace mvstudio::triangulate
