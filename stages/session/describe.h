#pragma once

#include "stages/result.h"
#include "stages/session/run.h"

namespace mvstudio::stages {

CommandResult Describe(const SessionInitReport& report);
CommandResult Describe(const SessionShowReport& report);
CommandResult Describe(const SessionTrustReport& report);
/// Cameras without a frame of a time step make it partial.
CommandResult Describe(const SessionTimelineReport& report);

}  // namespace mvstudio::stages
