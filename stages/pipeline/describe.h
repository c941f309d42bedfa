#pragma once

#include <string>

#include "stages/pipeline/run.h"

namespace mvstudio::stages {

/// "  620 MB,     4 MB on disk" of fixed width, blank where it is not known.
std::string NeedText(const StageNeed& need);

/// The table of the graph: state, seconds and reason of each stage that was asked for.
CommandResult Describe(const PipelineReport& report);

}  // namespace mvstudio::stages
