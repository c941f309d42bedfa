// Private: shared by the searches of one kind of board each.
#pragma once

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/detect/detect_board.h"

namespace mvstudio::calib {

/// Corners located so far: id, position, and the expected accuracy of the fit. Board coordinates in squares, y in row steps.
struct Located {
  explicit Located(const Board& board) : on_board(CornersInBoard(board).topRows<2>()) {
    on_board.row(0) /= board.square_m, on_board.row(1) /= board.row_step();
  }

  Eigen::Matrix2Xd on_board;  // (2, num_corners)
  std::vector<int> ids;
  std::vector<Eigen::Vector2d> px;
  std::vector<double> sigma_px, square_px;

  Eigen::Matrix2Xd Px() const {
    Eigen::Matrix2Xd points(2, px.size());
    for (size_t i = 0; i < px.size(); ++i) points.col(i) = px[i];
    return points;
  }
  Eigen::Matrix2Xd OnBoard() const {
    Eigen::Matrix2Xd points(2, ids.size());
    for (size_t i = 0; i < ids.size(); ++i) points.col(i) = on_board.col(ids[i]);
    return points;
  }
  bool Has(int id) const { return std::find(ids.begin(), ids.end(), id) != ids.end(); }
};

/// A board that is not there.
BoardDetection NotDetected(Status status, const std::string& reason);

/// What `locate` finds at the options' limit of misfit; where they leave it open, at both limits (BoardDetection::soft).
/// `num_guesses`: corners that were tried.
BoardDetection SharpAndSoft(const DetectOptions& options, size_t num_guesses,
                            const std::function<BoardDetection(const DetectOptions&)>& locate);

/// Keeps the corners that lie on the smooth image of a plane.
BoardDetection CheckLocated(const Board& board, const Located& located, const DetectOptions& options);

/// Detects a grid of circles that are dark on `grey`; it must be visible as a whole.
BoardDetection DetectCircleGrid(const Board& board, const Image& grey, const DetectOptions& options);

}  // namespace mvstudio::calib
