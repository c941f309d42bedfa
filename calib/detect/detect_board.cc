#include "calib/detect/detect_board.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "calib/board/charuco_layout.h"
#include "calib/board/homography.h"
#include "calib/board/sets.h"
#include "calib/detect/corner_search.h"
#include "calib/detect/locate_board.h"
#include "core/check.h"
#include "core/error.h"
#include "core/fields.h"
#include "core/format.h"
#include "core/statistics.h"

namespace mvstudio::calib {

namespace {

constexpr ChoiceWords<Detector, 2> kDetectors = {{{Detector::kFast, "fast"}, {Detector::kExact, "exact"}}};
constexpr double kMaxMisplaced =
    0.1;  // of the markers, but always one: a wrong layout may displace as few as one marker in every other row
constexpr char kMarkersMisplaced[] =
    "the markers do not lie as on the board (wrong numbers of squares or tags, gap, or layout)";

bool Misplaced(const MarkerSearch& search) {
  return search.num_markers - search.num_agreeing > std::max(1.0, kMaxMisplaced * search.num_markers);
}

/// Whether the board is there in the mirrored image, in any layout of the same colours: more markers in their places than in
/// the image itself.
bool SeenInMirror(const Board& board, const Image& searched, int num_agreeing) {
  const FoundMarkers found = FindMarkers(board, FlippedLeftRight(searched));
  const int needed = std::max(board.kind == Board::Kind::kTag ? 1 : 3, 2 * num_agreeing);
  for (const Board& layout : LayoutsOf(board)) {
    if (layout.inverted != board.inverted) continue;
    const MarkerSearch search = PlaceCorners(layout, found);
    if (search.num_agreeing >= needed && !Misplaced(search)) return true;
  }
  return false;
}

BoardDetection DetectAmongMarkers(const Board& board, const Image& searched, const FoundMarkers& found,
                                  const DetectOptions& options) {
  const MarkerSearch search = PlaceCorners(board, found);
  BoardDetection result;
  if (search.num_markers == 0 && found.num_repeated > 0) {
    result = NotDetected(Status::kDegenerate, "a tag of the board is seen more than once");
  } else if (Misplaced(search)) {
    result = NotDetected(Status::kDegenerate, kMarkersMisplaced);
  } else if (search.guesses.empty()) {
    result = NotDetected(Status::kTooFewViews, board.has_tags() ? "no tag of the board found" : "no marker of the board found");
  } else {
    result = LocateBoard(board, searched, search.guesses, options);
  }
  result.num_markers = search.num_agreeing;
  result.legacy = board.legacy, result.inverted = board.inverted;
  return result;
}

/// An image with the markers found in it so far.
class MarkedImage {
 public:
  explicit MarkedImage(Image grey) : grey_(std::move(grey)) {}

  const Image& grey() const { return grey_; }
  const Image& For(const Board& board) { return board.inverted ? Negative() : grey_; }
  const FoundMarkers& Markers(const Board& board) {
    const auto [found, is_new] = markers_.try_emplace(MarkerKey(board));
    if (is_new) found->second = FindMarkers(board, For(board));
    return found->second;
  }

 private:
  const Image& Negative() {
    if (!negative_.empty()) return negative_;
    negative_ = grey_;
    for (uint8_t& value : negative_.pixels) value = 255 - value;
    return negative_;
  }

  Image grey_, negative_;
  std::map<std::string, FoundMarkers> markers_;
};

std::vector<BoardDetection> DetectLayouts(const Board& board, const DetectOptions& options, MarkedImage* image) {
  std::vector<BoardDetection> result;
  bool found = false;
  int num_agreeing = 0;
  for (const Board& layout : LayoutsOf(board)) {
    if (found && layout.inverted != board.inverted) {
      result.push_back(NotDetected(Status::kTooFewViews, "black and white are not exchanged"));
      result.back().legacy = layout.legacy, result.back().inverted = layout.inverted;
      continue;
    }
    result.push_back(DetectAmongMarkers(layout, image->For(layout), image->Markers(layout), options));
    found = found || result.back().seen();
    num_agreeing = std::max(num_agreeing, result.back().num_markers);
  }
  if (!found && options.check_mirror && SeenInMirror(board, image->For(board), num_agreeing)) {
    result[0] = NotDetected(Status::kDegenerate, kMirroredReason);
  }
  return result;
}

/// One result for each of the board's layouts.
std::vector<BoardDetection> DetectChessboard(const Board& board, const DetectOptions& options, MarkedImage* image) {
  const std::vector<Board> layouts = LayoutsOf(board);
  const bool exact = options.detector == Detector::kExact;
  ChessboardFind found = SearchChessboard(board, image->grey(), exact ? ChessboardSearch::kExact : ChessboardSearch::kFast);
  if (found.guesses.empty() && exact) {  // light squares that run into a light ground
    Board inverted = board, exchanged = board;
    inverted.inverted = true, exchanged.inverted = !board.inverted;
    found = SearchChessboard(exchanged, image->For(inverted), ChessboardSearch::kExact);
  }
  std::vector<BoardDetection> result(layouts.size(), NotDetected(Status::kTooFewViews, "no chessboard found"));
  if (!found.guesses.empty()) {
    const size_t fitting = found.exchanged ? 1 : 0;
    const char* const why = fitting == 0 ? "black and white are not exchanged" : "black and white are exchanged";
    for (size_t l = 0; l < layouts.size(); ++l) {
      result[l] = l == fitting ? LocateBoard(layouts[l], image->For(layouts[l]), found.guesses, options)
                               : NotDetected(Status::kDegenerate, why);
    }
  }
  for (size_t l = 0; l < layouts.size(); ++l) result[l].inverted = layouts[l].inverted;
  return result;
}

/// The same of a grid of circles.
std::vector<BoardDetection> DetectCircles(const Board& board, const DetectOptions& options, MarkedImage* image) {
  std::vector<BoardDetection> result;
  bool found = false;
  for (const Board& layout : LayoutsOf(board)) {
    result.push_back(found ? NotDetected(Status::kTooFewViews, "black and white are not exchanged")
                           : DetectCircleGrid(layout, image->For(layout), options));
    result.back().inverted = layout.inverted;
    found |= result.back().seen();
  }
  if (!found && result.size() > 1 && result[0].status == Status::kTooFewViews) result[0].reason = result[1].reason;
  return result;
}

/// A corner of the image in a mirror as one of the back in the image itself.
void MoveToBack(const Board& board, int width_px, BoardDetection* found) {
  for (int& id : found->detection.corner_ids) id += board.num_side_corners();
  found->detection.points_px.row(0) = width_px - 1.0 - found->detection.points_px.row(0).array();
  for (BoardDetection& soft : found->soft) MoveToBack(board, width_px, &soft);
}

/// The front, or where it is not there the back.
std::vector<BoardDetection> DetectSides(const Board& board, const DetectOptions& given, MarkedImage* image,
                                        MarkedImage* mirror) {
  DetectOptions options = given;
  options.check_mirror = false;
  const auto seen = [](const BoardDetection& d) { return d.seen(); };
  std::vector<BoardDetection> front = DetectLayouts(FrontOf(board), options, image);
  if (std::any_of(front.begin(), front.end(), seen)) return front;
  std::vector<BoardDetection> back = DetectLayouts(FrontOf(board), options, mirror);
  if (std::none_of(back.begin(), back.end(), seen)) return front;
  for (BoardDetection& layout : back) MoveToBack(board, mirror->grey().width, &layout);
  return back;
}

}  // namespace

Image FlippedLeftRight(const Image& image) {
  Image flipped(image.width, image.height, image.channels);
  for (int v = 0; v < image.height; ++v) {
    for (int u = 0; u < image.width; ++u) {
      const uint8_t* from = image.Pixel(image.width - 1 - u, v);
      std::copy(from, from + image.channels, flipped.Pixel(u, v));
    }
  }
  return flipped;
}

std::string_view ToString(Detector detector) { return WordOf(kDetectors, detector); }

void FromString(const std::string& text, Detector* detector) {
  *detector = KnownChoice(kDetectors, text, "detector '" + text + "' is unknown: use fast or exact");
}

Image ToGrey(const Image& image) {
  if (image.channels == 1) return image;
  Image grey(image.width, image.height, 1);
  for (size_t i = 0; i < grey.pixels.size(); ++i) {
    const uint8_t* rgb = image.pixels.data() + i * image.channels;
    grey.pixels[i] = static_cast<uint8_t>((rgb[0] * 4899 + rgb[1] * 9617 + rgb[2] * 1868 + 8192) >> 14);
  }
  return grey;
}

namespace {

/// Whether exchanged colours make another board of it than a turn of the same print.
bool MayBeInverted(const Board& board) {
  if (board.kind == Board::Kind::kChessboard)
    return (board.cols + board.rows) % 2 == 0 && !(board.cols == board.rows && board.cols % 2 == 1);
  return board.kind == Board::Kind::kCharuco || board.is_round();
}

}  // namespace

std::vector<Board> LayoutsOf(const Board& board) {
  std::vector<Board> layouts = {board};
  if (HasTwoLayouts(board) && !board.legacy) {
    layouts.push_back(board);
    layouts.back().legacy = true;
  }
  if (!MayBeInverted(board) || board.inverted) return layouts;
  for (size_t l = 0, n = layouts.size(); l < n; ++l) {
    layouts.push_back(layouts[l]);
    layouts.back().inverted = true;
  }
  return layouts;
}

int NumCornersSeen(const BoardDetection& found) {
  const BoardDetection& more = found.soft.empty() ? found : found.soft[0];
  return more.status == Status::kOk ? more.detection.num_corners() : 0;
}

size_t BetterLayout(const std::vector<BoardDetection>& layouts) {
  size_t best = 0;
  for (size_t l = 1; l < layouts.size(); ++l) {
    if (NumCornersSeen(layouts[l]) > NumCornersSeen(layouts[best])) best = l;
  }
  return best;
}

void RequireSearchable(const Board& board) {
  if (IsSet(board))
    throw UsageError("board " + ToString(board) + " is a set of tags, and one board is wanted here: name one of them");
  if (board.kind == Board::Kind::kGrid || board.kind == Board::Kind::kPoints)
    throw UsageError("board " + ToString(board) + " cannot be searched in images: its corners come from files");
  const bool alike = board.kind == Board::Kind::kCircles || (board.kind == Board::Kind::kChessboard && board.cols % 2 == 0);
  if (board.row_step_m > 0 && board.cols == board.rows && alike) {
    throw UsageError("board " + ToString(board) +
                     " cannot be searched in images: its columns and rows look alike, but have different steps; use a board "
                     "of more columns than rows");
  }
}

std::vector<std::vector<BoardDetection>> DetectBoards(const std::vector<Board>& boards, const Image& image,
                                                      const DetectOptions& options) {
  MVS_CHECK(image.channels == 1 || image.channels == 3, image.channels << " channels");
  MarkedImage marked(ToGrey(image));
  std::optional<MarkedImage> mirror;
  std::vector<std::vector<BoardDetection>> result;
  for (const Board& board : boards) {
    RequireSearchable(board);
    if (board.back_m) {
      if (!mirror) mirror.emplace(FlippedLeftRight(marked.grey()));
      result.push_back(DetectSides(board, options, &marked, &*mirror));
      continue;
    }
    result.push_back(board.kind == Board::Kind::kChessboard ? DetectChessboard(board, options, &marked)
                     : board.is_round()                     ? DetectCircles(board, options, &marked)
                                                            : DetectLayouts(board, options, &marked));
  }
  return result;
}

BoardDetection DetectBoard(const Board& board, const Image& image, const DetectOptions& options) {
  const auto layouts = DetectBoards({board}, image, options)[0];
  const BoardDetection& best = layouts[BetterLayout(layouts)];
  return best.status != Status::kOk && best.seen() ? best.soft[0] : best;
}

}  // namespace mvstudio::calib
