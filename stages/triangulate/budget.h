#pragma once

#include <vector>

#include "core/progress.h"
#include "stages/input/pose_input.h"
#include "stages/triangulate/report.h"

namespace mvstudio::stages {

/// `count` frames in four stretches, one at a seeded place in each quarter of the take; all where there are no more.
std::vector<triangulate::DetectedFrame> StretchesOf(const std::vector<triangulate::DetectedFrame>& frames, size_t count,
                                                    uint64_t seed);

/// Tries the settings that nobody gave on stretches of the take, and sets the options of `report` to the chosen ones.
/// TriangulateReport::budget then holds the prediction; `started_s`: of the clock, when the command began. Throws UsageError
/// for a budget that no setting keeps.
void ChooseWithinBudget(const PoseInput& input, double started_s, const RunContext& run, TriangulateReport* report);

/// What came of it is added to the prediction, and both to predictions.jsonl in the output folder.
void KeepOutcome(double started_s, TriangulateReport* report);

}  // namespace mvstudio::stages
