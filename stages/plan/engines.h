#pragma once

#include <string>
#include <vector>

#include "stages/plan/options.h"
#include "stages/plan/plan.h"

/// Files by which schedulers do the tasks of a plan.
namespace mvstudio::stages {

/// This program by its path, for schedulers that have another PATH.
std::string ProgramPath();

/// build.ninja, submit.sh or Snakefile.
std::string EngineFile(Engine engine);

/// The text of that file for the tasks `ids` of the plan, in rising order. Throws UsageError for a path that holds a line
/// break.
std::string EngineText(Engine engine, const Plan& plan, const std::vector<int>& ids, const EngineOptions& options);

}  // namespace mvstudio::stages
