#include "stages/pipeline/do_stage.h"

#include <algorithm>
#include <filesystem>

#include "core/log.h"

namespace mvstudio::stages {
namespace {

/// Commands that replace what they wrote earlier without being told to.
bool IsToldToReplace(StageKind kind) {
  return kind != StageKind::kVerify && kind != StageKind::kPack && kind != StageKind::kReport;
}

StageWords Refusal(const PipelineStage& stage, StageRow* row) {
  row->state = RowState::kFailed, row->reason = "RUN-EXISTS", row->exit = kExitUsage;
  return {kExitUsage,
          {},
          {{"RUN-EXISTS", stage.output + " was made by other means and is older than what it is made of",
            "option 'again' replaces it; move it away to keep it"}}};
}

void JudgeEnd(const PipelineStage& stage, const StageWords& said, const StageWish& wish, StageRow* row) {
  const bool accepted = said.exit == kExitQualityGate && !said.errors.empty() &&
                        std::all_of(said.errors.begin(), said.errors.end(), [&](const Notice& error) {
                          return std::find(wish.accept.begin(), wish.accept.end(), error.code) != wish.accept.end();
                        });
  const bool without = stage.may_fail && (said.exit == kExitQualityGate || said.exit == kExitIllPosed);
  if (said.exit == kExitOk || said.exit == kExitPartial) {
    row->state = said.exit == kExitOk ? RowState::kDone : RowState::kPartial;
  } else {
    row->state = accepted ? RowState::kAccepted : without ? RowState::kWithout : RowState::kFailed;
    row->reason = said.errors.empty() ? "exit code " + std::to_string(said.exit) : said.errors.front().code;
  }
}

}  // namespace

StageWords DoStage(const PipelineStage& stage, StageRecord record, const StageRecord* earlier, const StageWish& wish,
                   const StageKeeper& keep, const StageCall& call, StageRow* row) {
  CommandLine line = stage.line();
  const bool known = earlier != nullptr, told = IsToldToReplace(stage.kind);
  if (told && !known && !wish.again && std::filesystem::exists(stage.output)) return Refusal(stage, row);
  if (told && (known || wish.again)) line.options.push_back({"overwrite", {}});
  record.exit = kBegun;
  keep(&record);
  Log(LogLevel::kInfo, row->stage + " (" + row->reason + "): " + line.Text());
  const CallOutcome outcome = call(line);
  const StageWords said = {outcome.result.exit, outcome.result.warnings, outcome.result.errors};
  row->exit = said.exit;
  row->seconds = outcome.seconds;
  JudgeEnd(stage, said, wish, row);
  record.output = FingerprintOf(stage.output);
  record.output.path = InSession(stage.output, stage.session);
  record.exit = row->exit;
  if (std::isfinite(row->seconds)) record.seconds = row->seconds;
  if (row->state == RowState::kAccepted) record.accepted = wish.accept;
  if (row->state == RowState::kFailed) record.errors = said.errors;
  const bool refused = row->exit == kExitUsage && !known;  // what was in its way, and it has to refuse it the next time
  keep(refused ? nullptr : &record);
  return said;
}

}  // namespace mvstudio::stages
