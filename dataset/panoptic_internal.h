#pragma once

#include "dataset/json_internal.h"
#include "geometry/rig.h"

namespace mvstudio::dataset::internal {

/// One entry of "cameras"; `drift` receives the distance of R from the nearest rotation.
geometry::RigCamera ReadPanopticCamera(const JsonView& json, double* drift);

}  // namespace mvstudio::dataset::internal
