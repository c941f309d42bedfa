#pragma once

#include "stages/board/run.h"
#include "stages/result.h"

namespace mvstudio::stages {

CommandResult Describe(const BoardDrawn& drawn);

/// Every board that was tried, every tag that was seen, and how the board is written; an error where none was found.
CommandResult Describe(const BoardSearched& searched);

CommandResult Describe(const BoardsProposed& proposed);

}  // namespace mvstudio::stages
