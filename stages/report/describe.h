#pragma once

#include "stages/report/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Where the page is, and what it says first.
CommandResult Describe(const PageReport& report);

}  // namespace mvstudio::stages
