#pragma once

#include <vector>

#include "stages/pipeline/do_stage.h"
#include "stages/pipeline/options.h"

/// The stages of a session one after the other, as far as they have to be done.
namespace mvstudio::stages {

struct PipelineReport {
  bool dry_run = false;
  std::vector<PipelineStage> stages;
  std::vector<StageRow> rows;  ///< one a stage
  StageRecords records;        ///< as they are kept now
  std::vector<Notice> warnings, errors;
  int exit = 0;          ///< of the first stage that failed
  bool partial = false;  ///< some stage left cameras or frames out
};

/// SESSION/run.json, where `run` keeps what it knows of each stage.
std::string RecordsPath(const std::string& session);

/// `run`, and with `dry_run` only the judgement of every stage, which is also what a plan is made of: then nothing is called
/// and nothing is written. A stage that fails stops it, and the report is still made. Throws UsageError, IoError, FormatError
/// for a session that cannot be read.
PipelineReport RunPipeline(const PipelineOptions& options, const PipelineTools& tools);

}  // namespace mvstudio::stages
