#pragma once

#include "core/progress.h"
#include "stages/budget/report.h"
#include "stages/nets/mask/make.h"

namespace mvstudio::stages {

/// What a budget chose for masks: what is learned already need not be learned again.
struct ChosenMasks {
  BudgetReport budget;
  MaskTrial learned;  ///< with its models; its failed camera: nothing separates people from background, and nothing is chosen
  MaskBackend backend;
};

/// Tries backends and the settings of their outlines on a few time steps, and sets what nobody gave among `mask-coarse-side`,
/// `mask-outline` and `hull` of the job. An error is the disagreement with the visual hull, in percent. `folder`: exists, for
/// masks that do not stay. `started_s`: of the clock, when the command began; `reading_s`: what decoding all footage took.
/// Throws UsageError without a calibration of two cameras, and for a budget that no setting keeps.
ChosenMasks ChooseMasks(const std::vector<MaskBackend>& backends, const MaskStageOptions& options, const std::string& folder,
                        double started_s, double reading_s, const RunContext& run, MaskJob* job);

}  // namespace mvstudio::stages
