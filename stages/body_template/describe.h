#pragma once

#include "stages/body_template/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Sizes, shapes, and the bones of each role.
CommandResult Describe(const BodyTemplateReport& report);

}  // namespace mvstudio::stages
