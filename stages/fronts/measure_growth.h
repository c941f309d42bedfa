// Private: growth on synthetic studios, for run.cc.
#pragma once

#include <string>
#include <vector>

#include "core/progress.h"
#include "stages/fronts/growth.h"
#include "stages/fronts/meter.h"

namespace mvstudio::stages {

/// Steps that MeasureGrowth advances.
int NumGrownStudios(bool quick);
/// The smallest one, in words.
std::string GrownStudio(bool quick);

/// Every stage but `pack` without flags, on studios with more cameras, more frames, more pixels. `only`: stages; empty for all.
/// Throws IoError where a studio cannot be made.
std::vector<GrowthRow> MeasureGrowth(const FrontsMeter& meter, const std::vector<std::string>& only, bool quick,
                                     ProgressStage* stage);

}  // namespace mvstudio::stages
