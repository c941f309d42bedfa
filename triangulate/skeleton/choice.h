// Private: a step of RefineSkeleton.
#pragma once

#include <vector>

#include "triangulate/skeleton/refine.h"
#include "triangulate/skeleton/window.h"

namespace mvstudio::triangulate::internal {

/// Decides which terms are used and with what weights; `terms` holds the values that the take itself gives. Fills the
/// report except its bones.
Terms ChooseTerms(const PreparedRig& rig, const std::vector<Window>& persons, const Bones& bones, const PointSolver& solve,
                  const SkeletonRefineOptions& options, Terms terms, const RunContext& run, SkeletonRefineReport* report);

}  // namespace mvstudio::triangulate::internal
