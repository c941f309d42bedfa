#pragma once

#include "stages/body_mesh/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// How many meshes of which size were written.
CommandResult Describe(const BodyMeshReport& report);

}  // namespace mvstudio::stages
