#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "cli/program/command.h"
#include "stages/pipeline/record.h"

/// One stage of a pipeline, for `run` and for `task`.
namespace mvstudio::cli {

using stages::PipelineStage;
using stages::StageKind;
using stages::StageRecord;

/// "  620 MB,     4 MB on disk" of fixed width, blank where it is not known.
std::string NeedText(const stages::StageNeed& need);

/// What became of a stage.
enum class RowState { kUpToDate, kLeftOut, kNotAsked, kDone, kPartial, kAccepted, kWithout, kFailed, kNotReached, kToDo };

constexpr ChoiceWords<RowState, 10> kStateWords = {{{RowState::kUpToDate, "up to date"},
                                                    {RowState::kLeftOut, "not needed"},
                                                    {RowState::kNotAsked, "not asked for"},
                                                    {RowState::kDone, "done"},
                                                    {RowState::kPartial, "done in part"},
                                                    {RowState::kAccepted, "accepted"},
                                                    {RowState::kWithout, "gone on without"},
                                                    {RowState::kFailed, "failed"},
                                                    {RowState::kNotReached, "not reached"},
                                                    {RowState::kToDo, "to do"}}};
inline std::string_view ToString(RowState state) { return WordOf(kStateWords, state); }

struct StageRow {
  std::string stage, reason, command;
  RowState state = RowState::kNotReached;
  double seconds = NAN;  ///< to do: as long as it took last time
  int exit = 0;
  stages::StageNeed need;  ///< of a dry run
};

template <class Visitor>
void VisitFields(Visitor&& visit, const StageRow& row) {
  visit("stage", row.stage);
  visit("state", row.state);
  visit("reason", row.reason);
  visit("seconds", row.seconds);
  visit("exit", row.exit);
  visit("memory_mb", row.need.memory_mb);
  visit("disk_mb", row.need.disk_mb);
  visit("command", row.command);
}

struct StageWish {
  std::vector<std::string> accept;  ///< codes of errors that do not stop it
  bool again = false;               ///< what others made is replaced
};

/// Keeps what is known of the stage from now on; nullptr: nothing is.
using StageKeeper = std::function<void(const StageRecord*)>;

/// Does the stage. `record`: its inputs as they are before; it is kept as begun before and as ended after. `earlier`: nullptr
/// where the stage was never begun; its output was then made by others, and is an error (RUN-EXISTS) unless it may be replaced.
/// Returns the stage's result; its state, seconds and exit code are in `row`.
CommandResult DoStage(const PipelineStage& stage, StageRecord record, const StageRecord* earlier, const StageWish& wish,
                      const StageKeeper& keep, CommandContext& context, StageRow* row);

}  // namespace mvstudio::cli
