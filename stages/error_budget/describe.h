#pragma once

#include "stages/error_budget/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

/// Shares, what to improve next and what it would bring; the reliability of each stage. An error where nothing can be said.
CommandResult Describe(const ErrorBudgetReport& report);

}  // namespace mvstudio::stages
