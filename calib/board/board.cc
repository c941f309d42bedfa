#include "calib/board/board.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <opencv2/aruco.hpp>
#include <sstream>
#include <vector>

#include "calib/board/apriltag.h"
#include "calib/board/charuco_layout.h"
#include "core/error.h"
#include "core/format.h"
#include "core/text/words.h"

namespace mvstudio::calib {

const char* const kBoardForms =
    "chessboard:COLSxROWS:SQUARE (INNER corners), "
    "charuco:COLSxROWS:SQUARE:MARKER[:DICTIONARY][:legacy][:inverted][:first=ID] (squares), "
    "aprilgrid:COLSxROWS:SIDE:GAP/SIDE[:FAMILY][:first=ID][:border=CELLS] (tags, Kalibr's layout), "
    "tag:FAMILY:ID:SIDE[:border=CELLS] (one AprilTag) or "
    "grid:COLSxROWS:STEP (points, for corner files); charuco and aprilgrid with the same print in a mirror on the back: "
    "[:two-sided=THICKNESS]; "
    "e.g. chessboard:9x6:25mm, charuco:8x6:60mm:45mm:4x4_1000, aprilgrid:6x6:88mm:0.3:36h11, tag:36h11:7:100mm";

namespace {

using Parts = std::vector<std::string>;

struct Form {
  const char *kind, *form, *example;
};
constexpr Form kForms[] = {
    {"chessboard", "chessboard:COLSxROWS:SQUARE (INNER corners)", "chessboard:9x6:25mm"},
    {"charuco", "charuco:COLSxROWS:SQUARE:MARKER[:DICTIONARY][:legacy][:inverted][:first=ID][:two-sided=THICKNESS] (squares)",
     "charuco:8x6:60mm:45mm:4x4_1000"},
    {"aprilgrid",
     "aprilgrid:COLSxROWS:SIDE:GAP/SIDE[:FAMILY][:first=ID][:border=CELLS][:two-sided=THICKNESS] (tags, Kalibr's layout)",
     "aprilgrid:6x6:88mm:0.3:36h11"},
    {"tag", "tag:FAMILY:ID:SIDE[:border=CELLS] (one AprilTag)", "tag:36h11:7:100mm"},
    {"grid", "grid:COLSxROWS:STEP (points, for corner files)", "grid:9x6:25mm"}};

/// The kind of the text's first part, by the names that other programs give it too; null for an unknown one.
const Form* FormOf(const std::string& text) {
  std::string kind = PlainWord(text.substr(0, text.find(':')));
  if (kind == "checkerboard" || kind == "checker" || kind == "chess") kind = "chessboard";
  if (kind == "charucoboard") kind = "charuco";
  if (kind == "apriltaggrid" || kind == "aprilboard") kind = "aprilgrid";
  if (kind == "apriltag") kind = "tag";
  for (const Form& form : kForms) {
    if (kind == form.kind) return &form;
  }
  return nullptr;
}

[[noreturn]] void Fail(const std::string& text, const std::string& what) {
  const Form* const form = FormOf(text);
  throw UsageError("board '" + text + "': " + what + "; expected " +
                   (form ? std::string(form->form) + ", e.g. " + form->example : std::string(kBoardForms)));
}

Parts Split(const std::string& text) {
  Parts parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ':');) parts.push_back(part);
  return parts;
}

/// A finite number and what follows it.
double LeadingNumber(const std::string& text, const std::string& board, std::string* rest) {
  size_t used = 0;
  double value = 0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    Fail(board, "'" + text + "' is not a number");
  }
  if (!std::isfinite(value)) Fail(board, "'" + text + "' is not finite");
  *rest = text.substr(used);
  return value;
}

/// Metres.
double ParseDistance(const std::string& text, const std::string& board) {
  std::string unit;
  const double value = LeadingNumber(text, board, &unit);
  const std::map<std::string, double> units = {{"mm", 1e-3}, {"cm", 1e-2}, {"m", 1}, {"in", 0.0254}};
  const auto known = units.find(PlainWord(unit));
  if (known == units.end()) {
    Fail(board, unit.empty() ? "the length '" + text + "' has no unit: write " + text + "mm, " + text + "cm, " + text +
                                   "m or " + text + "in"
                             : "the unit of '" + text + "' is none of mm, cm, m and in");
  }
  const double metres = value * known->second;
  if (!(metres >= 0) || !std::isfinite(metres)) Fail(board, "the length '" + text + "' must be positive");
  return metres;
}

double ParseLength(const std::string& text, const std::string& board) {
  const double metres = ParseDistance(text, board);
  if (metres == 0) Fail(board, "the length '" + text + "' must be positive");
  return metres;
}

int ParseCount(const std::string& text, const std::string& board, int low, int high) {
  int value = 0;
  char end = 0;
  if (std::sscanf(text.c_str(), "%9d%c", &value, &end) != 1 || value < low || value > high) {
    Fail(board, "'" + text + "' is not a number from " + std::to_string(low) + " to " + std::to_string(high));
  }
  return value;
}

void ParseGridSize(const std::string& text, const std::string& board, int least, Board* out) {
  char end = 0;
  if (std::sscanf(text.c_str(), "%5d%*1[xX*]%5d%c", &out->cols, &out->rows, &end) != 2)
    Fail(board, "'" + text + "' is not COLSxROWS");
  if (std::min(out->cols, out->rows) < least || std::max(out->cols, out->rows) > 200) {
    Fail(board, "the grid " + text + " must be from " + std::to_string(least) + "x" + std::to_string(least) + " to 200x200");
  }
}

/// The value of a part `key=value`, or nothing.
const char* ValueOf(const std::string& part, const std::string& key) {
  return part.rfind(key + "=", 0) == 0 ? part.c_str() + key.size() + 1 : nullptr;
}

/// The parts that boards with markers have in common; false when `part` is none of them.
bool ParseMarkerPart(const std::string& part, const std::string& text, Board* board) {
  const char* first = ValueOf(part, "first");
  const char* back = ValueOf(part, "two-sided");
  if (first) board->first_tag = ParseCount(first, text, 0, 99999);
  if (back) board->back_m = ParseDistance(back, text);
  if (part == "two-sided") Fail(text, "how thick is it? two-sided=3mm, or two-sided=0mm when it is printed through");
  return first || back;
}

void CheckMarkers(const Board& board, const std::string& text) {
  const int index = DictionaryIndex(board.dictionary);
  if (index < 0) Fail(text, "unknown dictionary '" + board.dictionary + "'; known are " + DictionaryNames());
  const int available = cv::aruco::getPredefinedDictionary(index)->bytesList.rows;
  if (board.first_tag + static_cast<int>(MarkerSquares(board).size()) > available) {
    Fail(text, "dictionary " + board.dictionary + " has only " + std::to_string(available) + " markers");
  }
}

Board ParseCharuco(const Parts& parts, const std::string& text) {
  Board board;
  board.kind = Board::Kind::kCharuco;
  if (parts.size() < 4 || parts.size() > 9) Fail(text, "a ChArUco board has 4 to 9 parts");
  ParseGridSize(parts[1], text, 2, &board);
  if (board.cols < 3 || board.rows < 3) Fail(text, "a ChArUco board needs at least 3x3 squares");
  board.cols -= 1, board.rows -= 1;
  board.square_m = ParseLength(parts[2], text);
  board.marker_m = ParseLength(parts[3], text);
  if (board.marker_m >= board.square_m) Fail(text, "the marker must be smaller than the square");
  for (size_t i = 4; i < parts.size(); ++i) {
    if (PlainWord(parts[i]) == "legacy") {
      board.legacy = true;
    } else if (PlainWord(parts[i]) == "inverted") {
      board.inverted = true;
    } else if (!ParseMarkerPart(parts[i], text, &board)) {
      board.dictionary = CanonicalDictionary(parts[i]);
    }
  }
  CheckMarkers(board, text);
  return board;
}

void CheckTags(const Board& board, const std::string& text) {
  const auto family = FindTagFamily(board.dictionary);
  if (!family) Fail(text, "unknown AprilTag family '" + board.dictionary + "'; known: " + TagFamilyNames());
  const int num_tags = board.kind == Board::Kind::kTag ? 1 : board.cols * board.rows;
  if (board.first_tag + num_tags > family->num_tags) {
    Fail(text, "family " + family->name + " has only the tags 0 to " + std::to_string(family->num_tags - 1));
  }
  if (family->white_inside && board.tag_border != 1) Fail(text, "the border of family " + family->name + " cannot be changed");
  const double outside = family->white_inside ? (family->total_cells - family->border_cells) / (2.0 * family->border_cells) : 0;
  if (board.kind == Board::Kind::kAprilGrid && !(board.tag_spacing >= 2 * outside)) {
    Fail(text, "the tags of family " + family->name + " reach beyond their border and would overlap with this gap");
  }
}

Board ParseAprilGrid(const Parts& parts, const std::string& text) {
  Board board;
  board.kind = Board::Kind::kAprilGrid;
  board.dictionary = "36h11";
  if (parts.size() < 4 || parts.size() > 8) Fail(text, "an AprilGrid has 4 to 8 parts");
  ParseGridSize(parts[1], text, 1, &board);
  board.square_m = ParseLength(parts[2], text);
  std::string rest;
  board.tag_spacing = LeadingNumber(parts[3], text, &rest);
  if (!rest.empty() || board.tag_spacing <= 0 || board.tag_spacing > 10) {
    Fail(text, "'" + parts[3] + "' is not the gap between tags divided by their side, e.g. 0.3");
  }
  int border = 0;
  for (size_t i = 4; i < parts.size(); ++i) {
    if (const char* width = ValueOf(parts[i], "border")) {
      border = ParseCount(width, text, 1, 2);
    } else if (!ParseMarkerPart(parts[i], text, &board)) {
      board.dictionary = CanonicalTagFamily(parts[i]);
    }
  }
  const auto family = FindTagFamily(board.dictionary);
  board.tag_border = border ? border : family && family->white_inside ? 1 : 2;
  CheckTags(board, text);
  return board;
}

Board ParseTag(const Parts& parts, const std::string& text) {
  Board board;
  board.kind = Board::Kind::kTag;
  board.cols = board.rows = 1;
  if (parts.size() < 4 || parts.size() > 5) Fail(text, "a tag has 4 or 5 parts");
  board.dictionary = CanonicalTagFamily(parts[1]);
  board.first_tag = ParseCount(parts[2], text, 0, 99999);
  board.square_m = ParseLength(parts[3], text);
  if (parts.size() == 5) {
    const char* width = ValueOf(parts[4], "border");
    if (!width) Fail(text, "'" + parts[4] + "' is not border=CELLS");
    board.tag_border = ParseCount(width, text, 1, 2);
  }
  CheckTags(board, text);
  return board;
}

Board ParseGrid(const Parts& parts, Board::Kind kind, const std::string& text) {
  Board board;
  board.kind = kind;
  if (parts.size() != 3) Fail(text, "a " + parts[0] + " has 3 parts");
  ParseGridSize(parts[1], text, 2, &board);
  board.square_m = ParseLength(parts[2], text);
  return board;
}

std::string Number(double value) { return Format("%.10g", value); }

std::string Millimetres(double length_m) { return Number(length_m * 1e3) + "mm"; }

/// Tags have families of their own; a smaller dictionary of ArUco markers is the beginning of a larger one (4x4_50, 4x4_1000).
std::string FamilyOf(const Board& board) {
  const bool numbered = !board.has_tags() && board.dictionary.find('x') != std::string::npos;
  return numbered ? board.dictionary.substr(0, board.dictionary.find('_')) : board.dictionary;
}

int NumMarks(const Board& board) {
  return board.has_tags() ? board.cols * board.rows : static_cast<int>(MarkerSquares(board).size());
}

std::string Size(int cols, int rows) { return std::to_string(cols) + "x" + std::to_string(rows); }

}  // namespace

Board ParseBoard(const std::string& text) {
  const Parts parts = Split(text);
  const Form* const form = FormOf(text);
  if (!form) {
    const std::string kind = parts.empty() ? "" : parts[0];
    Fail(text,
         "unknown kind of board" + DidYouMean(kind, {"chessboard", "checkerboard", "charuco", "aprilgrid", "tag", "grid"}));
  }
  const std::string kind = form->kind;
  if (kind == "chessboard") return ParseGrid(parts, Board::Kind::kChessboard, text);
  if (kind == "charuco") return ParseCharuco(parts, text);
  if (kind == "aprilgrid") return ParseAprilGrid(parts, text);
  if (kind == "tag") return ParseTag(parts, text);
  return ParseGrid(parts, Board::Kind::kGrid, text);
}

std::string ToString(const Board& board) {
  const std::string border = ":border=" + std::to_string(board.tag_border);
  const std::string first = board.first_tag ? ":first=" + std::to_string(board.first_tag) : "";
  const std::string back = board.back_m ? ":two-sided=" + Millimetres(*board.back_m) : "";
  switch (board.kind) {
    case Board::Kind::kCharuco:
      return "charuco:" + Size(board.cols + 1, board.rows + 1) + ":" + Millimetres(board.square_m) + ":" +
             Millimetres(board.marker_m) + ":" + board.dictionary + (board.legacy ? ":legacy" : "") +
             (board.inverted ? ":inverted" : "") + first + back;
    case Board::Kind::kAprilGrid: {
      const auto family = FindTagFamily(board.dictionary);
      const int usual = family && family->white_inside ? 1 : 2;
      return "aprilgrid:" + Size(board.cols, board.rows) + ":" + Millimetres(board.square_m) + ":" + Number(board.tag_spacing) +
             ":" + board.dictionary + first + (board.tag_border == usual ? "" : border) + back;
    }
    case Board::Kind::kTag:
      return "tag:" + board.dictionary + ":" + std::to_string(board.first_tag) + ":" + Millimetres(board.square_m) +
             (board.tag_border == 1 ? "" : border);
    case Board::Kind::kPoints:
      return "points:" + std::to_string(board.num_corners());
    default:
      return (board.kind == Board::Kind::kGrid ? "grid:" : "chessboard:") + Size(board.cols, board.rows) + ":" +
             Millimetres(board.square_m);
  }
}

int Board::num_side_corners() const {
  switch (kind) {
    case Kind::kAprilGrid:
      return 4 * cols * rows;
    case Kind::kTag:
      return 4;
    case Kind::kPoints:
      return static_cast<int>(points.cols());
    default:
      return cols * rows;
  }
}

Eigen::Matrix3Xd CornersInBoard(const Board& board) {
  if (board.kind == Board::Kind::kPoints) return board.points;
  const int side = board.num_side_corners();
  Eigen::Matrix3Xd corners(3, board.num_corners());
  for (int i = 0; i < side; ++i) {
    if (board.has_tags()) {
      const int tag = i / 4, k = i % 4;
      const double pitch = 1 + board.tag_spacing;
      const double x = tag % board.cols * pitch + (k == 1 || k == 2), y = tag / board.cols * pitch + (k >= 2);
      corners.col(i) = Eigen::Vector3d(x, -y, 0) * board.square_m;
    } else {
      corners.col(i) = Eigen::Vector3d(i % board.cols, i / board.cols, 0) * board.square_m;
    }
  }
  if (!board.back_m) return corners;
  corners.rightCols(side) = corners.leftCols(side);
  corners.rightCols(side).row(2).setConstant(*board.back_m);
  return corners;
}

Board FrontOf(Board board) {
  board.back_m.reset();
  return board;
}

std::string SharedMarks(const Board& a, const Board& b) {
  const bool tags = a.has_tags() && b.has_tags();
  const bool markers = a.kind == Board::Kind::kCharuco && b.kind == Board::Kind::kCharuco;
  if (!tags && !markers) return a.kind == b.kind && ToString(a) == ToString(b) ? "everything" : "";
  if (FamilyOf(a) != FamilyOf(b)) return "";
  const int first = std::max(a.first_tag, b.first_tag);
  const int last = std::min(a.first_tag + NumMarks(a), b.first_tag + NumMarks(b)) - 1;
  if (first > last) return "";
  return (tags ? "tags " : "markers ") + std::to_string(first) + " to " + std::to_string(last) + " of " + FamilyOf(a);
}

}  // namespace mvstudio::calib
