#pragma once

#include <vector>

#include "calib/lens/lens_pool.h"
#include "calib/lens/model_selection.h"

/// Which lenses are worth comparing.
namespace mvstudio::calib {

/// Most corners with a weight that one camera of the pool has.
int LargestNumCorners(const LensPool& pool);

/// Clusters of views per camera of the pool.
std::vector<int> ClustersOfCameras(const LensPool& pool);

/// What `options` asks for; else all lenses that the field of view and the number of corners allow, those with few numbers alone
/// when `few`. Fewest numbers first.
std::vector<LensConfig> Configurations(const LensPool& pool, const SelectionOptions& options, bool few);

/// Share of the image (a grid over it, its border included) that a lens cannot see, being folded over there.
double FoldedShare(const geometry::Camera& camera);

}  // namespace mvstudio::calib
