#pragma once

#include <functional>

#include "core/progress.h"
#include "stages/calibrate/run.h"

namespace mvstudio::stages {

/// What is done with corners before they are solved; it may change the options of the report, which is a trial's own.
using PrepareCorners = std::function<void(CalibrateReport* report, CornerInput* corners)>;

/// Searches part of the footage and solves three sizes of it, with the lens left open and with the lens that was found; sets
/// what nobody gave among `every` and `model` to the chosen setting. CalibrateReport::budget then holds the prediction;
/// `started_s`: of the clock, when the command began. An error is the stated uncertainty: of projections at the image's sides,
/// px, as CalibrateOptions::need_px limits it, or of points triangulated where boards were, mm (UncertaintySummary). Throws
/// UsageError where the part gives no calibration and for a budget that no setting keeps.
void ChooseCalibration(double started_s, const PrepareCorners& prepare, const RunContext& run, CalibrateReport* report);

/// What came of it is added to the prediction, and both to predictions.jsonl in the output folder.
void KeepCalibrationOutcome(double started_s, CalibrateReport* report);

}  // namespace mvstudio::stages
