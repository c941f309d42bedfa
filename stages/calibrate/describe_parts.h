#pragma once

#include "stages/calibrate/run.h"
#include "stages/result.h"

/// CalibrateReport::found in words and figures. What was written before stands in `report`.
namespace mvstudio::stages {

CommandResult DescribeFound(const CalibrateReport& report, const MarkedCalibration& found);
CommandResult DescribeFound(const CalibrateReport& report, const calib::SceneResectionReport& found);
CommandResult DescribeFound(const CalibrateReport& report, const calib::FromSceneReport& found);

/// calibration.json, and what its covariance lacks. `also`: cameras whose errors were unknown to the stage.
CommandResult DescribeWritten(const CalibrateReport& report, const geometry::Rig& rig,
                              const std::vector<std::string>& also = {});

}  // namespace mvstudio::stages
