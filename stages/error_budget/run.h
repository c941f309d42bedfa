#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/progress.h"
#include "stages/error_budget/options.h"
#include "stages/input_notes.h"
#include "triangulate/budget/budget.h"
#include "triangulate/budget/reliability.h"
#include "triangulate/budget/stated.h"

namespace mvstudio::stages {

/// Whether the sigmas of one stage are true.
struct StageReliability {
  std::string stage;
  triangulate::Reliability is;
  std::string why_none;  ///< no errors with sigmas
};

struct ErrorBudgetReport {
  InputNotes notes;
  std::optional<triangulate::ErrorBudget> budget;   ///< with truth
  std::optional<triangulate::StatedBudget> stated;  ///< without
  std::vector<StageReliability> reliability;
  std::string folder, page;  ///< empty without a place for them
};

/// Throws UsageError, IoError, FormatError. A take that shares nothing with its truth, and one in which no camera can be held
/// out, are no errors (num of its measures).
ErrorBudgetReport RunErrorBudget(const ErrorBudgetOptions& options, const RunContext& run = {});

/// Shares and reliability diagrams as one page.
std::string ErrorBudgetPage(const ErrorBudgetReport& report);

}  // namespace mvstudio::stages
