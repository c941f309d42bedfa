#pragma once

#include <string>
#include <vector>

#include "calib/calibrate.h"
#include "calib/detect/detect_footage.h"
#include "stages/calib/film_gain.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Metrics of `calibrate` and `calib refine`. `found` is empty for corner files.
nlohmann::ordered_json CalibrateMetrics(const calib::CalibrateReport& report,
                                        const std::vector<calib::FootageDetections>& found);

/// "film_gain" in the metrics, and a line of text for each.
CommandResult DescribeFilmGain(const calib::CalibrateReport& report, const std::vector<FilmGain>& gains);

/// Summary for the terminal.
std::string CalibrateSummary(const calib::CalibrateReport& report);

/// The status and its reasons, each with its level, code and text.
nlohmann::ordered_json VerdictJson(const calib::Verdict& verdict);

/// "verdict: fail: REASON (CODE) and 2 more": the first reason that decides.
std::string VerdictLine(const calib::Verdict& verdict);

}  // namespace mvstudio::stages
