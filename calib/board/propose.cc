#include "calib/board/propose.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "calib/board/print.h"
#include "core/error.h"
#include "core/format.h"

namespace mvstudio::calib {
namespace {

/// Squares a row and column of what is proposed; an odd and an even number, so that a chessboard has one orientation.
struct Shape {
  Board::Kind kind;
  int cols, rows;
};
constexpr Shape kShapes[] = {
    {Board::Kind::kCharuco, 7, 5},    {Board::Kind::kCharuco, 9, 6},    {Board::Kind::kCharuco, 12, 9},
    {Board::Kind::kChessboard, 6, 5}, {Board::Kind::kChessboard, 9, 6}, {Board::Kind::kAprilGrid, 6, 4},
    {Board::Kind::kAprilGrid, 8, 6},
};

Board WithSide(const Board& shape, double side_mm) {
  Board board = shape;
  const double scale = shape.square_m > 0 ? side_mm / 1e3 / shape.square_m : 1;
  board.row_step_m *= scale, board.circle_m *= scale;
  const double ratio = shape.square_m > 0 ? shape.marker_m / shape.square_m : 0;
  board.square_m = side_mm / 1e3;
  // Markers in whole mm where that changes their share little: such lengths can be measured with a ruler.
  const double marker_mm = ratio * side_mm;
  board.marker_m = (marker_mm >= 10 ? std::floor(marker_mm) : std::floor(10 * marker_mm) / 10) / 1e3;
  return board;
}

bool Fits(const Board& board, Paper paper) {
  BoardDrawOptions options;
  options.paper = paper;
  return FitsPaper(board, options);
}

Board ShapeOf(const Shape& shape) {
  Board board;
  board.kind = shape.kind, board.cols = shape.cols, board.rows = shape.rows;
  board.square_m = 1;
  if (shape.kind == Board::Kind::kCharuco) board.marker_m = 0.75;
  if (shape.kind == Board::Kind::kAprilGrid) board.dictionary = "36h11", board.tag_spacing = 0.3, board.tag_border = 2;
  return board;
}

BoardProposal ProposalOf(const Board& board, const ProposeOptions& options) {
  const BoardPrint print = PrintOf(board);
  BoardProposal proposal{board};
  const Eigen::Vector2d size = print.high_m - print.low_m;
  proposal.width_m = size.x(), proposal.height_m = size.y();
  const double half_width = std::tan(options.fov_deg * M_PI / 360);  // of the image, at a distance of 1
  const double focal_px = options.image_width_px / (2 * half_width);
  proposal.near_m = size.x() / (2 * half_width);
  proposal.far_m = focal_px * board.square_m / LeastSquarePx(board.kind);
  return proposal;
}

}  // namespace

double LeastSquarePx(Board::Kind kind) {
  if (kind == Board::Kind::kChessboard) return 16;
  return kind == Board::Kind::kCharuco ? 22 : 44;
}

int LeastImageWidthPx(const BoardProposal& proposal, int image_width_px) {
  return static_cast<int>(std::ceil(image_width_px * proposal.near_m / proposal.far_m));
}

std::optional<Board> LargestOn(const Board& board, Paper paper) {
  if (paper == Paper::kNone) return board;
  const auto side = [](int step) { return step <= 50 ? step / 10.0 : step - 45.0; };  // 1, 1.1 … 5, 6, 7 … mm
  int low = 9, high = 2000;                                                           // steps that fit, and that do not
  if (!Fits(WithSide(board, side(low + 1)), paper)) return std::nullopt;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (Fits(WithSide(board, side(middle)), paper) ? low : high) = middle;
  }
  return WithSide(board, side(low));
}

std::vector<BoardProposal> ProposeBoards(const ProposeOptions& options) {
  if (options.paper == Paper::kNone) throw UsageError("option 'paper' must name a size: a4, a3, a2, a1 or letter");
  if (!(options.fov_deg >= 1 && options.fov_deg <= 170))
    throw UsageError(Format("option 'fov' %g must be 1 to 170 degrees", options.fov_deg));
  if (options.image_width_px < 16) throw UsageError("option 'image-width' must be 16 px or more");
  std::vector<BoardProposal> proposals;
  for (const Shape& shape : kShapes) {
    if (const auto board = LargestOn(ShapeOf(shape), options.paper)) proposals.push_back(ProposalOf(*board, options));
  }
  return proposals;
}

}  // namespace mvstudio::calib
