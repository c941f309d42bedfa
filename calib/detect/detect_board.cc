#include "calib/detect/detect_board.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "calib/board/charuco_layout.h"
#include "calib/board/homography.h"
#include "calib/detect/corner_search.h"
#include "core/check.h"
#include "core/error.h"
#include "core/fields.h"
#include "core/format.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

constexpr ChoiceWords<Detector, 2> kDetectors = {{{Detector::kFast, "fast"}, {Detector::kExact, "exact"}}};
constexpr double kMaxPlaneErrorSquares = 0.35;  // median distance from the homography; strong lenses distort a board by less
constexpr double kMaxSmoothSigmaPx = 1.0;
constexpr double kMaxMisplaced =
    0.1;  // of the markers, but always one: a wrong layout may displace as few as one marker in every other row
constexpr char kMarkersMisplaced[] =
    "the markers do not lie as on the board (wrong numbers of squares or tags, gap, or layout)";
constexpr int kGrowRounds = 8;  // from tags that were found to their neighbours
constexpr double kRejectSigmas = 8, kRejectFloorPx = 1.5;

BoardDetection Failed(Status status, const std::string& reason) {
  BoardDetection result;
  result.status = status;
  result.reason = reason;
  return result;
}

/// Corners located so far: id, position, and the expected accuracy of the fit. Board coordinates in squares.
struct Located {
  explicit Located(const Board& board) : on_board(CornersInBoard(board).topRows<2>() / board.square_m) {}

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

void Locate(const Board& board, const Image& grey, const std::vector<CornerGuess>& guesses, const RefineOptions& options,
            Located* out) {
  for (const CornerGuess& guess : guesses) {
    const RefinedCorner corner = RefineCorner(board, grey, guess, options);
    if (corner.status != Status::kOk) continue;
    out->ids.push_back(guess.corner_id);
    out->px.push_back(corner.px);
    out->sigma_px.push_back(corner.sigma_px);
    out->square_px.push_back(std::min(guess.along_x.norm(), guess.along_y.norm()));
  }
}

/// Takes out the corners for which `loose[i]` holds.
void Erase(const std::vector<bool>& loose, Located* located) {
  Located kept = *located;
  kept.ids.clear(), kept.px.clear(), kept.sigma_px.clear(), kept.square_px.clear();
  for (size_t i = 0; i < loose.size(); ++i) {
    if (loose[i]) continue;
    kept.ids.push_back(located->ids[i]), kept.px.push_back(located->px[i]);
    kept.sigma_px.push_back(located->sigma_px[i]), kept.square_px.push_back(located->square_px[i]);
  }
  *located = std::move(kept);
}

/// The corners of the outermost row (axis 1) or column (axis 0) on one side that lie away from the others' prediction.
/// Three or fewer corners at an edge can be fitted exactly and so hide their own error.
std::vector<bool> LooseOutside(const Located& located, int axis, bool high) {
  constexpr int kFewInLine = 3, kEnoughOthers = 8;
  constexpr double kMaxOffSquares = 0.25;
  const Eigen::Matrix2Xd on_board = located.OnBoard(), px = located.Px();
  const Eigen::Index n = on_board.cols();
  const double end = high ? on_board.row(axis).maxCoeff() : on_board.row(axis).minCoeff();
  std::vector<Eigen::Index> line, others;
  for (Eigen::Index i = 0; i < n; ++i) (std::abs(on_board(axis, i) - end) < 0.01 ? line : others).push_back(i);
  std::vector<bool> loose(static_cast<size_t>(n), false);
  if (line.size() > kFewInLine || others.size() < kEnoughOthers) return loose;
  const auto plane = PlaneToImage::Fit(on_board(Eigen::all, others), px(Eigen::all, others));
  if (!plane) return loose;
  for (const Eigen::Index i : line) {
    const double off = ((*plane)(on_board.col(i)) - px.col(i)).norm();
    loose[static_cast<size_t>(i)] = !(off <= kMaxOffSquares * located.square_px[static_cast<size_t>(i)]);
  }
  return loose;
}

/// From outside to inside, until every side is held by what lies within.
void DropLoose(Located* located) {
  for (bool dropped = true; dropped && located->ids.size() > 4;) {
    dropped = false;
    for (int side = 0; side < 4 && !dropped; ++side) {
      const std::vector<bool> loose = LooseOutside(*located, side / 2, side % 2 == 1);
      dropped = std::find(loose.begin(), loose.end(), true) != loose.end();
      if (dropped) Erase(loose, located);
    }
  }
}

/// Guesses of the corners not located yet, where the located ones say they should be.
std::vector<CornerGuess> GuessMissing(const Image& grey, const Located& located, const PlaneToImage& plane) {
  std::vector<CornerGuess> guesses;
  for (int id = 0; id < located.on_board.cols(); ++id) {
    if (located.Has(id)) continue;
    const Eigen::Vector2d at = located.on_board.col(id);
    double nearest = 1e9;
    for (int other : located.ids) nearest = std::min(nearest, (located.on_board.col(other) - at).norm());
    const Eigen::Vector2d px = plane(at);
    if (nearest > 1.5 || !px.allFinite() || px.x() < 0 || px.y() < 0 || px.x() > grey.width || px.y() > grey.height) continue;
    const auto step = [&](double x, double y) { return plane(at + Eigen::Vector2d(x, y)); };
    guesses.push_back({id, px, step(0.5, 0) - step(-0.5, 0), step(0, 0.5) - step(0, -0.5)});
  }
  return guesses;
}

int NeededCorners(const Board& board, const DetectOptions& options) {
  return std::max(4, std::min(options.min_corners, board.num_corners()));
}

/// Keeps the corners that lie on the smooth image of a plane.
BoardDetection CheckCorners(const Board& board, const Located& located, const DetectOptions& options) {
  BoardDetection result;
  result.num_found = static_cast<int>(located.ids.size());
  const auto plane = PlaneToImage::Fit(located.OnBoard(), located.Px());
  if (!plane) return Failed(Status::kDegenerate, "the corners found lie on one line");
  result.sigma_px = plane->sigma_px();
  const double square_px = UpperMedian(located.square_px, 0);
  if (plane->homography_median_px() > kMaxPlaneErrorSquares * square_px || plane->sigma_px() > kMaxSmoothSigmaPx) {
    return Failed(Status::kDegenerate,
                  Format("the corners found do not lie on a plane (%.1f px off)", plane->homography_median_px()));
  }
  const double limit = std::max(kRejectFloorPx, kRejectSigmas * plane->sigma_px());
  std::vector<int> kept;
  for (int i = 0; i < result.num_found; ++i) {
    if (plane->residuals_px()[i] <= limit) kept.push_back(i);
  }
  if (static_cast<int>(kept.size()) < NeededCorners(board, options))
    return Failed(Status::kOutlier, "too few corners agree with a plane");
  result.detection.points_px.resize(2, kept.size());
  for (size_t k = 0; k < kept.size(); ++k) {
    result.detection.corner_ids.push_back(located.ids[kept[k]]);
    result.detection.points_px.col(k) = located.px[kept[k]];
  }
  return result;
}

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
    result = Failed(Status::kDegenerate, "a tag of the board is seen more than once");
  } else if (Misplaced(search)) {
    result = Failed(Status::kDegenerate, kMarkersMisplaced);
  } else if (search.guesses.empty()) {
    result = Failed(Status::kTooFewViews, board.has_tags() ? "no tag of the board found" : "no marker of the board found");
  } else {
    result = LocateBoard(board, searched, search.guesses, options);
  }
  result.num_markers = search.num_agreeing;
  result.legacy = board.legacy, result.inverted = board.inverted;
  return result;
}

BoardDetection DetectChessboard(const Board& board, const Image& grey, const DetectOptions& options) {
  const auto guesses =
      SearchChessboard(board, grey, options.detector == Detector::kExact ? ChessboardSearch::kExact : ChessboardSearch::kFast);
  if (guesses.empty()) return Failed(Status::kTooFewViews, "no chessboard found");
  return LocateBoard(board, grey, guesses, options);
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
      result.push_back(Failed(Status::kTooFewViews, "black and white are not exchanged"));
      result.back().legacy = layout.legacy, result.back().inverted = layout.inverted;
      continue;
    }
    result.push_back(DetectAmongMarkers(layout, image->For(layout), image->Markers(layout), options));
    found = found || result.back().status == Status::kOk;
    num_agreeing = std::max(num_agreeing, result.back().num_markers);
  }
  if (!found && options.check_mirror && SeenInMirror(board, image->For(board), num_agreeing)) {
    result[0] = Failed(Status::kDegenerate, kMirroredReason);
  }
  return result;
}

/// A corner of the image in a mirror as one of the back in the image itself.
void MoveToBack(const Board& board, int width_px, Detection* detection) {
  for (int& id : detection->corner_ids) id += board.num_side_corners();
  detection->points_px.row(0) = width_px - 1.0 - detection->points_px.row(0).array();
}

/// The front, or where it is not there the back.
std::vector<BoardDetection> DetectSides(const Board& board, const DetectOptions& given, MarkedImage* image,
                                        MarkedImage* mirror) {
  DetectOptions options = given;
  options.check_mirror = false;
  const auto seen = [](const BoardDetection& d) { return d.status == Status::kOk; };
  std::vector<BoardDetection> front = DetectLayouts(FrontOf(board), options, image);
  if (std::any_of(front.begin(), front.end(), seen)) return front;
  std::vector<BoardDetection> back = DetectLayouts(FrontOf(board), options, mirror);
  if (std::none_of(back.begin(), back.end(), seen)) return front;
  for (BoardDetection& layout : back) MoveToBack(board, mirror->grey().width, &layout.detection);
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

bool HasUniqueNumbering(const Board& board) {
  return board.kind != Board::Kind::kChessboard || (board.cols + board.rows) % 2 == 1;
}

std::vector<Board> LayoutsOf(const Board& board) {
  std::vector<Board> layouts = {board};
  if (HasTwoLayouts(board) && !board.legacy) {
    layouts.push_back(board);
    layouts.back().legacy = true;
  }
  if (board.kind != Board::Kind::kCharuco || board.inverted) return layouts;
  for (size_t l = 0, n = layouts.size(); l < n; ++l) {
    layouts.push_back(layouts[l]);
    layouts.back().inverted = true;
  }
  return layouts;
}

size_t BetterLayout(const std::vector<BoardDetection>& layouts) {
  const auto score = [](const BoardDetection& d) { return d.status == Status::kOk ? d.detection.num_corners() : 0; };
  size_t best = 0;
  for (size_t l = 1; l < layouts.size(); ++l) {
    if (score(layouts[l]) > score(layouts[best])) best = l;
  }
  return best;
}

BoardDetection LocateBoard(const Board& board, const Image& grey, const std::vector<CornerGuess>& guesses,
                           const DetectOptions& options) {
  RefineOptions refine;
  refine.max_misfit = options.max_misfit;
  Located located(board);
  Locate(board, grey, guesses, refine, &located);
  size_t before = 0;
  for (int round = 0; round < (board.has_tags() ? kGrowRounds : 1); ++round) {
    DropLoose(&located);
    if (located.ids.size() < 6 || located.ids.size() == before) break;
    before = located.ids.size();
    const auto plane = PlaneToImage::Fit(located.OnBoard(), located.Px());
    if (plane) Locate(board, grey, GuessMissing(grey, located, *plane), refine, &located);
  }
  DropLoose(&located);
  const int needed = NeededCorners(board, options);
  if (static_cast<int>(located.ids.size()) < needed) {
    return Failed(Status::kOutlier,
                  "only " + std::to_string(located.ids.size()) + " sharp corners (" + std::to_string(needed) + " needed)");
  }
  return CheckCorners(board, located, options);
}

std::vector<std::vector<BoardDetection>> DetectBoards(const std::vector<Board>& boards, const Image& image,
                                                      const DetectOptions& options) {
  MVS_CHECK(image.channels == 1 || image.channels == 3, image.channels << " channels");
  MarkedImage marked(ToGrey(image));
  std::optional<MarkedImage> mirror;
  std::vector<std::vector<BoardDetection>> result;
  for (const Board& board : boards) {
    if (board.kind == Board::Kind::kGrid || board.kind == Board::Kind::kPoints) {
      throw UsageError("board " + ToString(board) + " cannot be searched in images: its corners come from files");
    }
    if (board.back_m) {
      if (!mirror) mirror.emplace(FlippedLeftRight(marked.grey()));
      result.push_back(DetectSides(board, options, &marked, &*mirror));
      continue;
    }
    result.push_back(board.kind == Board::Kind::kChessboard
                         ? std::vector<BoardDetection>{DetectChessboard(board, marked.grey(), options)}
                         : DetectLayouts(board, options, &marked));
  }
  return result;
}

BoardDetection DetectBoard(const Board& board, const Image& image, const DetectOptions& options) {
  const auto layouts = DetectBoards({board}, image, options)[0];
  return layouts[BetterLayout(layouts)];
}

}  // namespace mvstudio::calib
