#pragma once

#include "stages/compare/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// How far the two calibrations are apart, how far both covariances let expect, and which limits that breaks.
CommandResult Describe(const CompareReport& report);

}  // namespace mvstudio::stages
