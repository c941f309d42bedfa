// Private: for stages/error_budget/run.cc.
#pragma once

#include <optional>
#include <string>

#include "stages/error_budget/options.h"
#include "stages/input_notes.h"
#include "triangulate/budget/budget.h"

namespace mvstudio::stages {

struct BudgetInput {
  triangulate::BudgetTake take;
  std::optional<triangulate::BudgetTruth> truth;
  std::string folder;  ///< for results; may be empty
};

/// The take and its truth, if it has one. Throws UsageError where a part of the truth is missing, FormatError where its cameras
/// or joints are others.
BudgetInput ReadBudgetInput(ErrorBudgetOptions options, InputNotes* notes);

}  // namespace mvstudio::stages
