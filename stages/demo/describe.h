#pragma once

#include "stages/demo/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// The checks; exit code 4 where one is missed, unless it was a quick demo.
CommandResult Describe(const DemoReport& report);

}  // namespace mvstudio::stages
