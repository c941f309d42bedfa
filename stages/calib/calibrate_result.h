#pragma once

#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "calib/detect/detect_footage.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Metrics of `calibrate` and `calib refine`. `found` is empty for corner files.
void FillCalibrateMetrics(const calib::CalibrateReport& report, const std::vector<calib::FootageDetections>& found,
                          nlohmann::ordered_json* metrics);

/// What six more boards would be worth to cameras that lack corners (PredictGain): "film_gain" in the metrics, and a
/// line of text for each.
void AddFilmGain(const calib::CalibrateReport& report, const std::vector<calib::Board>& boards, CommandResult* result);

/// Summary for the terminal.
std::string CalibrateSummary(const calib::CalibrateReport& report);

/// The status and its reasons, each with its level, code and text.
nlohmann::ordered_json VerdictJson(const calib::Verdict& verdict);

/// "verdict: fail: REASON (CODE) and 2 more": the first reason that decides.
std::string VerdictLine(const calib::Verdict& verdict);

}  // namespace mvstudio::stages
