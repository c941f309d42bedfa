#pragma once

#include "stages/nets/render/run.h"

namespace mvstudio::stages {

/// What was rendered and from what, and where the avatar was not made for it.
CommandResult Describe(const AvatarRenderReport& report);

}  // namespace mvstudio::stages
