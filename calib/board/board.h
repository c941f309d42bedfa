#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "core/image.h"

namespace mvstudio::calib {

/// A planar calibration target. Its frame `board` lies in the printed plane. x points along the columns to the right, y
/// down as the reader of the print sees it, z = x cross y (into the board, away from the viewer of its printed side).
///
/// chessboard, charuco, grid, circles: corners are numbered row by row from the top left; corner (row, col) lies at
/// (col * square_m, row * row_step(), 0). Inner corners only: the outer squares lie around them. Of circles, their centres.
///
/// acircles: OpenCV's asymmetric grid. Circle (row, col) has the number row * cols + col and lies at (2 col + row % 2, row, 0)
/// * square_m.
///
/// aprilgrid, tag: tag number n has the id first_tag + n. It stands in column n % cols and row n / cols, counted from the
/// BOTTOM as Kalibr prints them. Its corners are 4 n + k with k = 0 bottom left, 1 bottom right, 2 top right, 3 top left
/// of the upright tag. The origin is the bottom left corner of tag 0, so y is negative on the rest of the board. A point
/// (x, y, z) is (x, -y, -z) in Kalibr's frame.
///
/// Two-sided (charuco, aprilgrid): the back carries the same print in a mirror, so that corner i of the back lies behind
/// corner i of the front, at z = back_m. Its number is num_side_corners() + i.
struct Board {
  enum class Kind {
    kChessboard,
    kCharuco,
    kAprilGrid,          ///< cols x rows AprilTags, gaps between them, Kalibr's numbering; a tag has 4 corners
    kTag,                ///< one AprilTag, 4 corners
    kGrid,               ///< any planar grid of points, found by others (corner files)
    kPoints,             ///< points given one by one, also in 3D (corner files alone)
    kCircles,            ///< circles in rows and columns
    kAsymmetricCircles,  ///< circles whose odd rows are shifted by half a step
  };
  Kind kind = Kind::kChessboard;
  int cols = 0;           ///< inner corners or circles per row; aprilgrid: tags per row
  int rows = 0;           ///< inner corners or circles per column; aprilgrid: tags per column
  double square_m = 0;    ///< side of a square, metres; aprilgrid and tag: side of the square whose corners are found, black in
                          ///< the classic families and white inside in the newer ones; circles: step between columns;
                          ///< acircles: half of that, which is the step between rows
  double row_step_m = 0;  ///< chessboard, grid, circles: step from row to row where it is not square_m; 0: it is
  double circle_m = 0;    ///< circles and acircles: diameter of a circle, for the print
  double marker_m = 0;    ///< charuco: side of a marker, metres
  std::string dictionary = "4x4_1000";  ///< charuco: OpenCV's predefined dictionary, lower case without DICT_; aprilgrid and
                                        ///< tag: the AprilTag family without "tag", e.g. 36h11
  bool legacy = false;     ///< charuco: layout of OpenCV before 4.6 (differs for an even number of squares per column)
  bool inverted = false;   ///< charuco, chessboard, circles: black and white exchanged (a chessboard's first square is white)
  double tag_spacing = 0;  ///< aprilgrid: gap between tags over the side of a tag
  int first_tag = 0;       ///< charuco, aprilgrid and tag: id of the first marker or tag
  int tag_border = 1;      ///< aprilgrid and tag: width of the black border in cells (classic families); Kalibr prints 2
  std::optional<double> back_m;  ///< charuco and aprilgrid with two sides: distance of the back, 0 or more
  Eigen::Matrix3Xd points;       ///< kPoints: (3, N) metres

  int num_corners() const { return num_side_corners() * (back_m ? 2 : 1); }
  int num_side_corners() const;
  double row_step() const { return row_step_m > 0 ? row_step_m : square_m; }
  bool is_round() const { return kind == Kind::kCircles || kind == Kind::kAsymmetricCircles; }
  bool has_tags() const { return kind == Kind::kAprilGrid || kind == Kind::kTag; }
};

/// The forms that ParseBoard reads, in one line.
extern const char* const kBoardForms;

/// Parses a board description, see kBoardForms. Units mm, cm, m or in are required; `points:FILE` reads that file. Throws
/// UsageError that says what was expected of that kind, FormatError and IoError for the file.
Board ParseBoard(const std::string& text);
/// The same as an option, see core/fields.h.
inline void FromString(const std::string& text, Board* board) { *board = ParseBoard(text); }

/// The text that ParseBoard reads back; kPoints, whose text is a file, gives `points:N`.
std::string ToString(const Board& board);

/// In how many of the four quarter turns of the print its corners or circles look alike, colours included: 1, 2 (half turns) or
/// 4. Where it is not 1, two images may number them from different ends. Of a grid, whose print nobody knows, what its points
/// alone allow.
int NumLikeTurns(const Board& board);

/// Corner positions in the frame board, metres, (3, num_corners()).
Eigen::Matrix3Xd CornersInBoard(const Board& board);

/// The board without its back.
Board FrontOf(Board board);

/// What two boards have in common that makes them one for a detector, in words: a range of markers or tags. Empty: nothing.
std::string SharedMarks(const Board& a, const Board& b);

/// Renders the printed side, of two-sided boards the front, in grey. One square (a tag's side) is `px_per_square` pixels; the
/// white margin on all sides is `margin_squares` squares. Every pixel is the exact mean over its area.
///
/// Board coordinates (x, y) of image pixel (u, v), with `low_m` of PrintOf(board) in print.h: x = low_m.x + ((u + 0.5) /
/// px_per_square - margin_squares) * square_m, same for y. For chessboard and charuco low_m = (-square_m, -row_step()). Not
/// for kGrid and kPoints, which have no print.
Image DrawBoard(const Board& board, int px_per_square, double margin_squares);

}  // namespace mvstudio::calib
