#pragma once

#include <string>
#include <vector>

#include "report/report.h"

/// Runs side by side: what got better, what got worse, what stayed within the stated spread, and what differs in their settings
/// and inputs.
namespace mvstudio::report {

/// `folders`: two runs or more, the earliest first; the last is judged against the first. Scores of held-out images are judged
/// only where both runs were scored on the same ones. JSON: schema mvstudio.comparison/1. `options.with` is not used. Throws
/// UsageError for a run that is given twice and for options that belong to one run, and what BuildReport throws.
Report BuildComparison(const std::vector<std::string>& folders, const ReportOptions& options = {});

}  // namespace mvstudio::report
