#pragma once

#include <vector>

#include "calib/lens/lens_pool.h"
#include "calib/lens/model_selection.h"

/// Lens configurations worth comparing.
namespace mvstudio::calib {

/// Largest number of weighted corners of one camera in the pool.
int LargestNumCorners(const LensPool& pool);

/// Clusters of views per camera of the pool.
std::vector<int> ClustersOfCameras(const LensPool& pool);

/// The configurations that `options` asks for; otherwise all lenses that the field of view and the number of corners
/// allow, those of more than four terms of distortion with at least as many places of the board. If `few`, only those with few
/// parameters. Fewest parameters first.
std::vector<LensConfig> Configurations(const LensPool& pool, const SelectionOptions& options, bool few);

}  // namespace mvstudio::calib
