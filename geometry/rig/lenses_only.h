#pragma once

#include "geometry/rig/rig.h"

namespace mvstudio::geometry {

/// Rig::gauge of lenses whose poses are unknown. The poses of such a rig are not used.
inline constexpr char kLensesOnly[] = "none: lenses only, every camera in a frame of its own";

/// Whether nothing says where the cameras are: the gauge says so, or all of two cameras and more stand at the origin and look
/// the same way, as programs write that have no poses.
bool HasLensesOnly(const Rig& rig);

}  // namespace mvstudio::geometry
