#pragma once

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/notice.h"
#include "stages/input/fingerprint.h"
#include "stages/pipeline/pipeline.h"

namespace mvstudio::stages {

inline constexpr int kBegun = -1;

/// What `run` knows of a stage that it has done, or has found done. Paths in the session begin in its folder, so that it may be
/// moved, and named in other ways.
struct StageRecord {
  std::string version;  ///< of mvstudio
  std::vector<std::string> words;
  int exit = 0;                       ///< kBegun until it has ended
  std::vector<std::string> accepted;  ///< codes of errors that were accepted
  std::vector<Notice> errors;         ///< of a stage that failed, for the report
  std::vector<std::string> told;      ///< of the report: FailuresIn the records that it shows
  double seconds = 0;
  bool found = false;  ///< made by other means than `run`, and newer than what it is made of
  std::vector<Fingerprint> inputs;
  Fingerprint output;
};

using StageRecords = std::map<std::string, StageRecord>;  ///< by PipelineStage::name()

/// A path of a session as records keep it: "." for the session, "raw/a.mp4" for what lies in it, others as they are.
std::string InSession(const std::string& path, const std::string& session);

/// SESSION/run.json; empty when it is not there. Throws FormatError.
StageRecords ReadStageRecords(const std::string& path);
void WriteStageRecords(const std::string& path, const StageRecords& records);

/// A line for each error of a stage that failed.
std::vector<std::string> FailuresIn(const StageRecords& records);

nlohmann::ordered_json PrintJson(const Fingerprint& print);
/// Throws the library's exception for what PrintJson did not write.
Fingerprint PrintFrom(const nlohmann::ordered_json& json);

/// Whether a stage's output is what it was when it was recorded: also where it had none.
bool IsSameOutput(const Fingerprint& now, const StageRecord& record);

/// Whether doing the same again would end alike, and the others can go on with it.
bool IsSettled(const PipelineStage& stage, const StageRecord& record);

/// A stage as it is now. `earlier` saves reading what was not touched since.
StageRecord RecordOf(const PipelineStage& stage, const std::string& version, const StageRecord* earlier);

/// Why a stage has to be done, in one line: never done, other flags, another input, no output, ended with an error, another
/// version, other failures to tell. Empty: what is there is what the stage would make.
std::string WhyStale(const PipelineStage& stage, const StageRecord& now, const StageRecord* earlier);

/// Whether there is an output that is newer than everything that the stage reads.
bool IsNewerThanInputs(const PipelineStage& stage);

/// As long as it took; NaN where that was not measured.
double SecondsOf(const StageRecord* earlier);

struct Judgement {
  StageRecord now;    ///< `found`: made by other means than `run`, and newer than what it is made of
  std::string stale;  ///< why it has to be done, or that it was found; empty: what is there holds
};

/// The one judgement of a stage, for `run`, its dry run, `plan` and `task`. `earlier`: nullptr where nothing is known of it.
/// `failures`: what a report has to tell of the others.
Judgement JudgeStage(const PipelineStage& stage, const std::string& version, const StageRecord* earlier,
                     const std::vector<std::string>& failures = {});

}  // namespace mvstudio::stages
