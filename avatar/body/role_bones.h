#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/body/bone_role.h"

namespace mvstudio::body {

/// Bones of a template by their roles.
struct RoleBones {
  int pelvis = -1, head = -1;
  std::vector<int> spine;                    // kSpine, then kChest; from the pelvis upwards
  std::vector<int> neck;                     // from the chest upwards
  std::array<std::array<int, 4>, 2> arms{};  // left, right: clavicle, upper arm, forearm, hand
  std::array<std::array<int, 3>, 2> legs{};  // left, right: thigh, shin, foot
};

/// "left upper arm", "other" for kOther.
std::string_view ToString(BoneRole role);

/// Throws ContractViolation unless the roles are complete: one pelvis, one head, at least one spine or chest bone and one neck
/// bone, and one of each role of the limbs. Bones of the spine and of the neck must descend from each other.
RoleBones FindRoleBones(const BodyTemplate& body);

/// The role of each bone, kOther replaced by that of the nearest ancestor with one; kPelvis above the pelvis. (B)
std::vector<BoneRole> InheritedRoles(const BodyTemplate& body);

}  // namespace mvstudio::body
