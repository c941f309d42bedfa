// Private: a step of the association across views.
#pragma once

#include <vector>

#include "triangulate/people/affinity.h"

namespace mvstudio::triangulate::internal {

/// Cluster index of each candidate: [candidate] -> 0 …; singles have an index of their own.
std::vector<int> ClusterCandidates(const std::vector<Candidate>& candidates, double sigma_px,
                                   const AssociationOptions& options);

}  // namespace mvstudio::triangulate::internal
