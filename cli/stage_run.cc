#include "cli/stage_run.h"

#include <algorithm>
#include <filesystem>

#include "cli/program/stage.h"
#include "core/format.h"
#include "core/join.h"
#include "core/log.h"

namespace mvstudio::cli {
namespace {

/// Commands that replace what they wrote earlier without being told to.
bool IsToldToReplace(StageKind kind) {
  return kind != StageKind::kVerify && kind != StageKind::kPack && kind != StageKind::kReport;
}

CommandResult Refusal(const PipelineStage& stage, StageRow* row) {
  CommandResult result;
  row->state = RowState::kFailed, row->reason = "RUN-EXISTS", row->exit = result.exit = kExitUsage;
  result.errors.push_back({"RUN-EXISTS", stage.output + " was made by other means and is older than what it is made of",
                           "--again replaces it; move it away to keep it"});
  return result;
}

void Judge(const PipelineStage& stage, const CommandResult& done, const StageWish& wish, StageRow* row) {
  const bool accepted = done.exit == kExitQualityGate && !done.errors.empty() &&
                        std::all_of(done.errors.begin(), done.errors.end(), [&](const Notice& error) {
                          return std::find(wish.accept.begin(), wish.accept.end(), error.code) != wish.accept.end();
                        });
  const bool without = stage.may_fail && (done.exit == kExitQualityGate || done.exit == kExitIllPosed);
  if (done.exit == kExitOk || done.exit == kExitPartial) {
    row->state = done.exit == kExitOk ? RowState::kDone : RowState::kPartial;
  } else {
    row->state = accepted ? RowState::kAccepted : without ? RowState::kWithout : RowState::kFailed;
    row->reason = done.errors.empty() ? "exit code " + std::to_string(done.exit) : done.errors.front().code;
  }
}

}  // namespace

std::string NeedText(const stages::StageNeed& need) {
  const auto cell = [](double value, const std::string& unit) {
    return std::isfinite(value) ? Format("%7.0f", value) + unit : std::string(7 + unit.size(), ' ');
  };
  return cell(need.memory_mb, " MB") + cell(need.disk_mb, " MB on disk");
}

CommandResult DoStage(const PipelineStage& stage, StageRecord record, const StageRecord* earlier, const StageWish& wish,
                      const StageKeeper& keep, CommandContext& context, StageRow* row) {
  std::vector<std::string> words = stage.Words("--");
  const bool known = earlier != nullptr, told = IsToldToReplace(stage.kind);
  if (told && !known && !wish.again && std::filesystem::exists(stage.output)) return Refusal(stage, row);
  if (told && (known || wish.again)) words.push_back("--overwrite");
  record.exit = stages::kBegun;
  keep(&record);
  Log(LogLevel::kInfo, row->stage + " (" + row->reason + "): mvstudio " + Join(words, " "));
  LineOutcome outcome = RunStage(words, context);
  row->exit = outcome.result.exit;
  row->seconds = outcome.json.is_object() ? outcome.json["timing"].value("wall_s", NAN) : NAN;
  Judge(stage, outcome.result, wish, row);
  record.output = stages::FingerprintOf(stage.output);
  record.exit = row->exit;
  if (std::isfinite(row->seconds)) record.seconds = row->seconds;
  if (row->state == RowState::kAccepted) record.accepted = wish.accept;
  if (row->state == RowState::kFailed) record.errors = outcome.result.errors;
  const bool refused = row->exit == kExitUsage && !known;  // what was in its way, and it has to refuse it the next time
  keep(refused ? nullptr : &record);
  return std::move(outcome.result);
}

}  // namespace mvstudio::cli
