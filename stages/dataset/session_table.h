#pragma once

#include <string>

#include "dataset/time/timeline.h"
#include "dataset/verify/session_check.h"
#include "stages/result.h"

/// Output of `session` and `doctor` on a session, as JSON and as text.
namespace mvstudio::stages {

nlohmann::ordered_json FootageJson(const dataset::SessionReport& report);
std::string FootageText(const dataset::SessionReport& report);

/// Findings as errors and warnings. Exit 3 when no footage is usable, 6 when some is not.
CommandResult DescribeFootageFindings(const dataset::SessionReport& report);

nlohmann::ordered_json TimelineJson(const dataset::Timeline& timeline);
std::string TimelineText(const dataset::Timeline& timeline);

}  // namespace mvstudio::stages
