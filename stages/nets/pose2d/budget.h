#pragma once

#include "core/progress.h"
#include "geometry/rig/rig.h"
#include "stages/budget/report.h"
#include "stages/nets/pose2d/detect.h"
#include "stages/nets/pose2d/options.h"

namespace mvstudio::stages {

/// Tries the installed nets and their qualities on a stretch of the footage, and sets what nobody gave among `backend` and
/// `quality` to the chosen ones. Only where none is quick enough, every Nth frame alone is looked at (`every`). An error is how
/// far a camera's keypoints lie from where the other cameras put them (PoseAgreement::median_px). `started_s`: of the clock,
/// when the command began. Throws UsageError without a calibration of two cameras and for a budget that no setting keeps.
BudgetReport ChooseNet(const DetectJob& job, const geometry::Rig& rig, double started_s, const RunContext& run,
                       Pose2dOptions* options);

}  // namespace mvstudio::stages
