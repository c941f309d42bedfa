#pragma once

#include "stages/nets/info/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

CommandResult Describe(const NetworkInfo& info);

}  // namespace mvstudio::stages
