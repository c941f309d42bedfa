#pragma once

#include <functional>
#include <string>
#include <vector>

#include "stages/pipeline/record.h"
#include "stages/pipeline/row.h"
#include "stages/stage_call.h"

/// One stage of a session, for `run` and for `task`.
namespace mvstudio::stages {

/// What they have from the program that they are part of.
struct PipelineTools {
  StageCall call;
  std::string version;  ///< of mvstudio
};

struct StageWish {
  std::vector<std::string> accept;  ///< codes of errors that do not stop it
  bool again = false;               ///< what others made is replaced
};

/// Keeps what is known of the stage from now on; nullptr: nothing is.
using StageKeeper = std::function<void(const StageRecord*)>;

/// What a stage had to say.
struct StageWords {
  int exit = 0;
  std::vector<Notice> warnings, errors;
};

/// Does the stage. `record`: its inputs as they are before; it is kept as begun before and as ended after. `earlier`: nullptr
/// where the stage was never begun; its output was then made by others, and is an error (RUN-EXISTS) unless it may be replaced.
/// Its state, seconds and exit code are put in `row`.
StageWords DoStage(const PipelineStage& stage, StageRecord record, const StageRecord* earlier, const StageWish& wish,
                   const StageKeeper& keep, const StageCall& call, StageRow* row);

}  // namespace mvstudio::stages
