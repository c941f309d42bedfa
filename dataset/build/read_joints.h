// Private: the 3D joints of BuildDataset.
#pragma once

#include "dataset/build/build.h"
#include "dataset/pose/pose3d.h"

namespace mvstudio::dataset::internal {

/// Those of the time steps that are asked for, numbered as the footage. What is to be said of them goes to `report`. Throws
/// FormatError where there is none.
Pose3d ReadJointsOf(const BuildInputs& inputs, BuildReport* report);

}  // namespace mvstudio::dataset::internal
