#include "calib/board/sides.h"

#include <cmath>

#include "core/error.h"

namespace mvstudio::calib {

bool ThicknessUnknown(const Board& board) { return board.back_m && std::isnan(*board.back_m); }

void RequireThickness(const std::vector<Board>& boards) {
  for (const Board& board : boards) {
    if (ThicknessUnknown(board))
      throw UsageError("board " + ToString(board) +
                       ": how thick is it? two-sided=3mm, or two-sided=0mm when it is printed through; only a calibration of a "
                       "rig estimates it");
  }
}

std::vector<int> PartSides(CalibrateInput* input) {
  std::vector<int> front_of(input->boards.size(), -1), back_of(input->boards.size(), -1);
  for (size_t b = 0; b < front_of.size(); ++b) {
    if (!ThicknessUnknown(input->boards[b])) continue;
    input->boards[b] = FrontOf(input->boards[b]);
    back_of[b] = static_cast<int>(input->boards.size());
    front_of.push_back(static_cast<int>(b));
    const Board back = input->boards[b];
    input->boards.push_back(back);
  }
  for (Detection& detection : input->detections) {
    const auto b = static_cast<size_t>(detection.board_idx);
    const int side = input->boards[b].num_side_corners();
    if (back_of[b] < 0 || detection.corner_ids.empty() || detection.corner_ids[0] < side) continue;
    detection.board_idx = back_of[b];
    for (int& id : detection.corner_ids) id -= side;
  }
  return front_of;
}

}  // namespace mvstudio::calib
