#include "geometry/rig/lenses_only.h"

#include <algorithm>
#include <cmath>

namespace mvstudio::geometry {

bool HasLensesOnly(const Rig& rig) {
  if (rig.gauge == kLensesOnly) return true;
  return rig.cameras.size() > 1 && std::all_of(rig.cameras.begin(), rig.cameras.end(), [](const RigCamera& camera) {
           const Rigid3& pose = camera.cam_from_world;
           return pose.translation.isZero(0) && pose.rotation.vec().isZero(0);
         });
}

}  // namespace mvstudio::geometry
