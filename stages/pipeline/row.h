#pragma once

#include <cmath>
#include <string>
#include <string_view>

#include "stages/pipeline/pipeline.h"

namespace mvstudio::stages {

/// What became of a stage.
enum class RowState { kUpToDate, kLeftOut, kNotAsked, kDone, kPartial, kAccepted, kWithout, kFailed, kNotReached, kToDo };

constexpr ChoiceWords<RowState, 10> kRowWords = {{{RowState::kUpToDate, "up to date"},
                                                  {RowState::kLeftOut, "not needed"},
                                                  {RowState::kNotAsked, "not asked for"},
                                                  {RowState::kDone, "done"},
                                                  {RowState::kPartial, "done in part"},
                                                  {RowState::kAccepted, "accepted"},
                                                  {RowState::kWithout, "gone on without"},
                                                  {RowState::kFailed, "failed"},
                                                  {RowState::kNotReached, "not reached"},
                                                  {RowState::kToDo, "to do"}}};
inline std::string_view ToString(RowState state) { return WordOf(kRowWords, state); }

struct StageRow {
  std::string stage, reason, command;
  RowState state = RowState::kNotReached;
  double seconds = NAN;  ///< to do: as long as it took last time
  int exit = 0;
  StageNeed need = {};  ///< of a dry run
  bool found = false;   ///< up to date, but made by other means than `run`
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
  visit("predicted_s", row.need.seconds);
  visit("command", row.command);
}

}  // namespace mvstudio::stages
