#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "dataset/session/session.h"
#include "stages/pipeline/options.h"
#include "stages/stage_call.h"

namespace mvstudio::stages {

/// What a stage needs of a machine. NaN: not known.
struct StageNeed {
  double memory_mb = NAN;  ///< MiB at once, on two cores
  double disk_mb = NAN;    ///< MiB of its output
  double seconds = NAN;    ///< of one thread
};

/// One stage of one session: the command line that does it, what it reads and what it writes. Paths begin as the session's.
struct PipelineStage {
  StageKind kind = StageKind::kCalibrate;
  std::string session;               ///< its folder
  std::string take;                  ///< empty: of the whole session
  std::vector<std::string> command;  ///< its words and what it is given without an option
  std::vector<LineOption> options;   ///< of the command line
  std::vector<std::string> inputs;   ///< files, folders and patterns; one that is missing is no input
  std::string output;                ///< a file or a folder
  std::string left_out;              ///< why this session does not need it; empty: it does
  bool may_fail = false;             ///< the others go on without its result
  StageNeed need = {};               ///< of a machine; filled by PredictNeeds
  std::string part = {};             ///< of a plan: what the task keeps for the stage, see StagePart; empty: the stage itself

  CommandLine line() const { return {command, options}; }
  std::string name() const;  ///< "calibrate", "triangulate take1", "mask take1 frames=cam_01:0-3"
};

/// All stages of a session, those that it does not need with the reason, each after those whose outputs it reads. What stands
/// under [run.STAGE] in mvstudio.toml is added to their command lines. Throws FormatError for a path that leaves the session or
/// a stage that is not known, UsageError for an unknown take, and for a session with neither a board nor a calibration.
std::vector<PipelineStage> PipelineOf(const dataset::Session& session, const PipelineOptions& options);

/// Whether `later` reads what `earlier` writes.
bool Reads(const PipelineStage& later, const PipelineStage& earlier);

/// Whether `from`, `to` and `only` ask for the stage. Throws UsageError for an unknown word, and when `to` is before `from`.
bool IsAskedFor(const PipelineStage& stage, const PipelineOptions& options);

}  // namespace mvstudio::stages
