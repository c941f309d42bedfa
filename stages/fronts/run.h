#pragma once

#include <string>

#include "core/progress.h"
#include "stages/fronts/fronts.h"
#include "stages/fronts/options.h"
#include "stages/input_notes.h"
#include "stages/result.h"
#include "stages/stage_call.h"

namespace mvstudio::stages {

struct FrontsReport {
  InputNotes notes;
  Fronts fronts;
  std::string page, results;  ///< that were written
};

/// Runs every way as a command of its own and writes the page and its results. What cannot be measured is in the report. Throws
/// UsageError for a stage that there is not, IoError and FormatError for a session that cannot be read; IoError with the
/// command where the synthetic studio cannot be made.
FrontsReport RunFronts(const FrontsOptions& options, const ChildCall& call, const RunContext& run = {});

/// A table for each stage. An error where not one stage could be measured.
CommandResult Describe(const FrontsReport& report);

}  // namespace mvstudio::stages
