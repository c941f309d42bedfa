#include "calib/board/charuco_layout.h"

#include <algorithm>
#include <iterator>
#include <string>

#include "core/join.h"
#include "core/text/words.h"

namespace mvstudio::calib {
namespace {

constexpr const char* kDictionaries[] = {
    "4x4_50",   "4x4_100",  "4x4_250",        "4x4_1000",      "5x5_50",        "5x5_100",        "5x5_250",
    "5x5_1000", "6x6_50",   "6x6_100",        "6x6_250",       "6x6_1000",      "7x7_50",         "7x7_100",
    "7x7_250",  "7x7_1000", "aruco_original", "apriltag_16h5", "apriltag_25h9", "apriltag_36h10", "apriltag_36h11"};

}  // namespace

bool IsBlack(const Board& board, Square square) {
  const bool shifted = board.kind == Board::Kind::kCharuco && board.legacy && (board.rows + 1) % 2 == 0;
  return ((square.col + square.row) % 2 == 0) != shifted;
}

std::vector<Square> MarkerSquares(const Board& board) {
  std::vector<Square> squares;
  if (board.kind != Board::Kind::kCharuco) return squares;
  for (int row = 0; row <= board.rows; ++row) {
    for (int col = 0; col <= board.cols; ++col) {
      if (!IsBlack(board, {col, row})) squares.push_back({col, row});
    }
  }
  return squares;
}

std::string DictionaryNames() { return Join(kDictionaries, ", "); }

std::string CanonicalDictionary(const std::string& name) {
  std::string plain = PlainWord(name);
  if (plain.rfind("dict", 0) == 0) plain.erase(0, 4);
  for (const std::string known : kDictionaries) {
    if (PlainWord(known) == plain) return known;
  }
  return name;
}

int DictionaryIndex(const std::string& name) {
  const auto found = std::find(std::begin(kDictionaries), std::end(kDictionaries), name);
  return found == std::end(kDictionaries) ? -1 : static_cast<int>(found - std::begin(kDictionaries));
}

bool HasTwoLayouts(const Board& board) { return board.kind == Board::Kind::kCharuco && (board.rows + 1) % 2 == 0; }

}  // namespace mvstudio::calib
