#pragma once

#include <vector>

#include "calib/board/board.h"

/// Sets of single tags or markers, `tag:4x4_50:0-19:60mm`: of known sides, whose places nobody measured.
namespace mvstudio::calib {

/// A set is a tag (Board::Kind::kTag) with more than one column; nothing but SingleBoards knows what to do with it.
inline bool IsSet(const Board& board) { return board.kind == Board::Kind::kTag && board.cols > 1; }

/// Every set as its tags, each a board of its own, whose place among the others a calibration tells.
std::vector<Board> SingleBoards(const std::vector<Board>& boards);

}  // namespace mvstudio::calib
