#pragma once

#include "geometry/rig/rig.h"

namespace mvstudio::geometry {

/// Whether nothing says where the cameras are: the gauge says so, or all of two cameras and more stand at the origin and look
/// the same way, as programs write that have no poses.
bool HasLensesOnly(const Rig& rig);

}  // namespace mvstudio::geometry
