#pragma once

#include "stages/result.h"
#include "stages/surface/run.h"

namespace mvstudio::stages {

/// An entry of metrics["bodies"] for each body and a row of the table for each of its sets of frames ("fitted": their images
/// took part in the fit; "other": the rest), lengths in centimetres. Exit code kExitBadInput when a body and the truth share no
/// frame, else kExitPartial when some frames have no score.
CommandResult Describe(const SurfaceReport& report);

}  // namespace mvstudio::stages
