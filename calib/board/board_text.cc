#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <opencv2/aruco.hpp>
#include <optional>
#include <sstream>
#include <vector>

#include "calib/board/apriltag.h"
#include "calib/board/board.h"
#include "calib/board/board_points.h"
#include "calib/board/board_target.h"
#include "calib/board/charuco_layout.h"
#include "calib/board/circles.h"
#include "calib/board/sets.h"
#include "calib/board/sides.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/text/words.h"

namespace mvstudio::calib {

const char* const kBoardForms =
    "chessboard:COLSxROWS:SQUARE[:inverted] (INNER corners), "
    "charuco:COLSxROWS:SQUARE:MARKER[:DICTIONARY][:legacy][:inverted][:first=ID] (squares), "
    "aprilgrid:COLSxROWS:SIDE:GAP/SIDE[:FAMILY][:first=ID][:border=CELLS] (tags, Kalibr's layout), "
    "tag:FAMILY:ID[-LAST]:SIDE[:border=CELLS] (AprilTags or ArUco markers, each a board of its own), "
    "circles:COLSxROWS:STEP[:DIAMETER][:inverted], acircles:COLSxROWS:STEP[:DIAMETER][:inverted] (OpenCV's asymmetric grid), "
    "grid:COLSxROWS:STEP (points, for corner files) or "
    "points:FILE (a table id,x,y,z, for corner files), or a target FILE.yaml of Kalibr; a SQUARE or STEP of two lengths, "
    "22.5x24.5mm, is along the columns and "
    "the rows; charuco and aprilgrid with the same print in a mirror on the back: [:two-sided[=THICKNESS]]; "
    "e.g. chessboard:9x6:25mm, charuco:8x6:60mm:45mm:4x4_1000, aprilgrid:6x6:88mm:0.3:36h11, tag:36h11:7:100mm";

namespace {

using Parts = std::vector<std::string>;

struct Form {
  const char *kind, *form, *example;
};
constexpr Form kForms[] = {
    {"chessboard", "chessboard:COLSxROWS:SQUARE[:inverted] (INNER corners; SQUARE also WIDTHxHEIGHT)", "chessboard:9x6:25mm"},
    {"charuco", "charuco:COLSxROWS:SQUARE:MARKER[:DICTIONARY][:legacy][:inverted][:first=ID][:two-sided=THICKNESS] (squares)",
     "charuco:8x6:60mm:45mm:4x4_1000"},
    {"aprilgrid",
     "aprilgrid:COLSxROWS:SIDE:GAP/SIDE[:FAMILY][:first=ID][:border=CELLS][:two-sided=THICKNESS] (tags, Kalibr's layout)",
     "aprilgrid:6x6:88mm:0.3:36h11"},
    {"tag", "tag:FAMILY:ID[-LAST]:SIDE[:border=CELLS] (AprilTags or ArUco markers: FAMILY 36h11, 4x4_50, …)",
     "tag:36h11:7:100mm"},
    {"circles", "circles:COLSxROWS:STEP[:DIAMETER][:inverted] (STEP also WIDTHxHEIGHT)", "circles:7x6:30mm"},
    {"acircles", "acircles:COLSxROWS:STEP[:DIAMETER][:inverted] (OpenCV's asymmetric grid; STEP from row to row)",
     "acircles:4x11:20mm"},
    {"grid", "grid:COLSxROWS:STEP (points, for corner files; STEP also WIDTHxHEIGHT)", "grid:9x6:25mm"},
    {"points", "points:FILE[:UNIT] (a table id,x,y,z, for corner files)", "points:target.csv:mm"}};

/// The kind of the text's first part, by the names that other programs give it too; null for an unknown one.
const Form* FormOf(const std::string& text) {
  std::string kind = PlainWord(text.substr(0, text.find(':')));
  if (kind == "checkerboard" || kind == "checker" || kind == "chess") kind = "chessboard";
  if (kind == "charucoboard") kind = "charuco";
  if (kind == "apriltaggrid" || kind == "aprilboard") kind = "aprilgrid";
  if (kind == "apriltag" || kind == "tags" || kind == "marker" || kind == "markers" || kind == "aruco") kind = "tag";
  if (kind == "circlegrid" || kind == "circlesgrid" || kind == "symmetriccircles") kind = "circles";
  if (kind == "acirclesgrid" || kind == "asymmetriccircles" || kind == "asymmetriccirclesgrid") kind = "acircles";
  for (const Form& form : kForms) {
    if (kind == form.kind) return &form;
  }
  return nullptr;
}

[[noreturn]] void Fail(const std::string& text, const std::string& what) {
  const Form* const form = FormOf(text);
  const std::string examples = Join(kForms, ", ", [](const Form& known) { return known.example; });
  throw UsageError("board '" + text + "': " + what + "; expected " +
                   (form ? std::string(form->form) + ", e.g. " + form->example : examples));
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
  if (text.find_first_of("xX") != std::string::npos) Fail(board, "'" + text + "' is not one number");
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
  const bool unknown = part == "two-sided";
  if (unknown) board->back_m = std::numeric_limits<double>::quiet_NaN();
  return first || back || unknown;
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
  if (!family)
    Fail(text, "unknown family '" + board.dictionary + "'; known: " + TagFamilyNames() + ", and of ArUco markers " +
                   DictionaryNames());
  if (family->aruco && board.kind == Board::Kind::kAprilGrid)
    Fail(text, "an AprilGrid has AprilTags; ArUco markers are single ones, tag:" + board.dictionary + ":0-" +
                   std::to_string(board.cols * board.rows - 1) + ":SIDE, or those of a ChArUco board");
  const int num_tags = board.cols * board.rows;
  if (board.first_tag + num_tags > family->num_tags) {
    Fail(text, "family " + family->name + " has only the tags 0 to " + std::to_string(family->num_tags - 1));
  }
  if ((family->white_inside || family->aruco) && board.tag_border != 1)
    Fail(text, "the border of family " + family->name + " cannot be changed");
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
  board.dictionary = CanonicalTagFamily(parts[1].rfind("apriltag_", 0) == 0 ? parts[1].substr(9) : parts[1]);
  const size_t dash = parts[2].find('-');
  board.first_tag = ParseCount(parts[2].substr(0, dash), text, 0, 99999);
  if (dash != std::string::npos)
    board.cols = ParseCount(parts[2].substr(dash + 1), text, board.first_tag, 99999) - board.first_tag + 1;
  board.square_m = ParseLength(parts[3], text);
  if (parts.size() == 5) {
    const char* width = ValueOf(parts[4], "border");
    if (!width) Fail(text, "'" + parts[4] + "' is not border=CELLS");
    board.tag_border = ParseCount(width, text, 1, 2);
  }
  CheckTags(board, text);
  return board;
}

/// One step, or `WIDTHxHEIGHT` of a cell; the unit of the second holds for a first one without.
void ParseSteps(const std::string& text, const std::string& board, Board* out) {
  const size_t cross = text.find_first_of("xX*");
  if (cross == std::string::npos) {
    out->square_m = ParseLength(text, board);
    return;
  }
  std::string width = text.substr(0, cross), height = text.substr(cross + 1);
  const size_t unit = height.find_first_not_of("0123456789.eE+-");
  if (width.find_first_not_of("0123456789.eE+-") == std::string::npos && unit != std::string::npos)
    width += height.substr(unit);
  out->square_m = ParseLength(width, board);
  const double row_step = ParseLength(height, board);
  if (std::max(out->square_m, row_step) > 10 * std::min(out->square_m, row_step))
    Fail(board, "a cell of '" + text + "' is more than ten times as long as wide");
  if (row_step != out->square_m) out->row_step_m = row_step;
}

Board ParseGrid(const Parts& parts, Board::Kind kind, const std::string& text) {
  Board board;
  board.kind = kind;
  const bool coloured = kind == Board::Kind::kChessboard;
  if (parts.size() < 3) Fail(text, "the numbers of columns and rows and a length are needed");
  if (parts.size() > (coloured ? 4 : 3)) Fail(text, "'" + parts.back() + "' is too much");
  ParseGridSize(parts[1], text, 2, &board);
  ParseSteps(parts[2], text, &board);
  if (parts.size() == 4 && PlainWord(parts[3]) != "inverted") Fail(text, "'" + parts[3] + "' is not 'inverted'");
  board.inverted = parts.size() == 4;
  return board;
}

Board ParseCircles(const Parts& parts, Board::Kind kind, const std::string& text) {
  Board board;
  board.kind = kind;
  if (parts.size() < 3) Fail(text, "the numbers of columns and rows and a length are needed");
  if (parts.size() > 5) Fail(text, "'" + parts.back() + "' is too much");
  ParseGridSize(parts[1], text, kind == Board::Kind::kCircles ? 3 : 2, &board);
  if (board.num_corners() < 9 || board.rows < 3) Fail(text, "a grid of circles needs 3 rows and 9 circles or more");
  const bool shifted = kind == Board::Kind::kAsymmetricCircles;
  shifted ? static_cast<void>(board.square_m = ParseLength(parts[2], text)) : ParseSteps(parts[2], text, &board);
  board.circle_m = UsualDiameter(board);
  for (size_t i = 3; i < parts.size(); ++i) {
    if (PlainWord(parts[i]) == "inverted") {
      board.inverted = true;
    } else {
      board.circle_m = ParseLength(parts[i], text);
    }
  }
  const double apart = shifted ? std::sqrt(2.0) * board.square_m : std::min(board.square_m, board.row_step());
  if (board.circle_m > 0.9 * apart)
    Fail(text, "circles of " + Format("%.4g mm", 1e3 * board.circle_m) + " touch, whose centres are " +
                   Format("%.4g mm", 1e3 * apart) + " apart");
  return board;
}

/// A name of a file, which may have colons, and a unit behind it.
Board ParsePoints(const std::string& text) {
  const size_t begin = text.find(':');
  std::string file = begin == std::string::npos ? "" : text.substr(begin + 1);
  const size_t colon = file.rfind(':');
  const std::map<std::string, double> units = {{"mm", 1e-3}, {"cm", 1e-2}, {"m", 1}, {"in", 0.0254}};
  const auto unit = colon == std::string::npos ? units.end() : units.find(file.substr(colon + 1));
  if (unit != units.end()) file.erase(colon);
  if (file.empty()) Fail(text, "which file?");
  Board board;
  board.kind = Board::Kind::kPoints;
  board.points = ReadBoardPoints(file, unit == units.end() ? std::nullopt : std::optional<double>(unit->second));
  return board;
}

std::string Number(double value) { return Format("%.10g", value); }

std::string Millimetres(double length_m) { return Number(length_m * 1e3) + "mm"; }

std::string Steps(const Board& board) {
  return board.row_step_m > 0 ? Number(board.square_m * 1e3) + "x" + Millimetres(board.row_step_m)
                              : Millimetres(board.square_m);
}

std::string Size(int cols, int rows) { return std::to_string(cols) + "x" + std::to_string(rows); }

}  // namespace

double UsualDiameter(const Board& board) {
  return board.kind == Board::Kind::kCircles ? 0.5 * std::min(board.square_m, board.row_step()) : 0.7 * board.square_m;
}

Board ParseBoard(const std::string& text) {
  if (internal::NamesTarget(text)) return ParseBoard(internal::BoardTextOfTarget(text));
  const Parts parts = Split(text);
  const Form* const form = FormOf(text);
  if (!form) {
    internal::RefuseFile(text);
    Fail(text, "unknown kind of board" +
                   DidYouMean(parts.empty() ? "" : parts[0], {"chessboard", "checkerboard", "charuco", "aprilgrid", "tag",
                                                              "circles", "acircles", "grid", "points"}));
  }
  const std::string kind = form->kind;
  if (kind == "chessboard") return ParseGrid(parts, Board::Kind::kChessboard, text);
  if (kind == "charuco") return ParseCharuco(parts, text);
  if (kind == "aprilgrid") return ParseAprilGrid(parts, text);
  if (kind == "tag") return ParseTag(parts, text);
  if (kind == "circles") return ParseCircles(parts, Board::Kind::kCircles, text);
  if (kind == "acircles") return ParseCircles(parts, Board::Kind::kAsymmetricCircles, text);
  if (kind == "points") return ParsePoints(text);
  return ParseGrid(parts, Board::Kind::kGrid, text);
}

std::string ToString(const Board& board) {
  const std::string border = ":border=" + std::to_string(board.tag_border);
  const std::string first = board.first_tag ? ":first=" + std::to_string(board.first_tag) : "";
  const std::string inverted = board.inverted ? ":inverted" : "";
  const std::string thickness = ThicknessUnknown(board) ? "" : "=" + Millimetres(board.back_m.value_or(0));
  const std::string back = board.back_m ? ":two-sided" + thickness : "";
  switch (board.kind) {
    case Board::Kind::kCharuco:
      return "charuco:" + Size(board.cols + 1, board.rows + 1) + ":" + Millimetres(board.square_m) + ":" +
             Millimetres(board.marker_m) + ":" + board.dictionary + (board.legacy ? ":legacy" : "") + inverted + first + back;
    case Board::Kind::kAprilGrid: {
      const auto family = FindTagFamily(board.dictionary);
      const int usual = family && family->white_inside ? 1 : 2;
      return "aprilgrid:" + Size(board.cols, board.rows) + ":" + Millimetres(board.square_m) + ":" + Number(board.tag_spacing) +
             ":" + board.dictionary + first + (board.tag_border == usual ? "" : border) + back;
    }
    case Board::Kind::kTag:
      return "tag:" + board.dictionary + ":" + std::to_string(board.first_tag) +
             (IsSet(board) ? "-" + std::to_string(board.first_tag + board.cols - 1) : "") + ":" + Millimetres(board.square_m) +
             (board.tag_border == 1 ? "" : border);
    case Board::Kind::kPoints:
      return "points:" + std::to_string(board.num_corners());
    case Board::Kind::kCircles:
    case Board::Kind::kAsymmetricCircles: {
      const bool usual = std::abs(board.circle_m - UsualDiameter(board)) < 1e-9;
      return (board.kind == Board::Kind::kCircles ? "circles:" : "acircles:") + Size(board.cols, board.rows) + ":" +
             Steps(board) + (usual ? "" : ":" + Millimetres(board.circle_m)) + inverted;
    }
    default:
      return (board.kind == Board::Kind::kGrid ? "grid:" : "chessboard:") + Size(board.cols, board.rows) + ":" + Steps(board) +
             inverted;
  }
}

}  // namespace mvstudio::calib
