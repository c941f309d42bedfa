#pragma once

#include <string>

#include "avatar/body/bone_role.h"

namespace mvstudio::body {

/// Role of a bone of the rigs cmu_mb and game_engine, whose names differ; kOther for all other names.
BoneRole RoleOfMakeHumanBone(const std::string& name);

}  // namespace mvstudio::body
