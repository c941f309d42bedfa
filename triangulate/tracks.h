#pragma once

#include <vector>

#include "triangulate/association.h"

namespace mvstudio::triangulate {

/// The people found in one frame.
struct TrackFrame {
  int frame = 0;
  std::vector<Cluster> clusters;
};

/// Gives clusters person numbers that last over frames: nearest skeletons are linked, and the links' chains are sorted by
/// support. A chain continues a better one (a person who left and came back, a cut) when both never appear together and it is
/// seen at least half as well. Returns [frame][person][camera] as AssociateTake does.
std::vector<std::vector<std::vector<int>>> FollowPersons(const std::vector<TrackFrame>& frames, size_t num_cameras,
                                                         const AssociationOptions& options);

}  // namespace mvstudio::triangulate
