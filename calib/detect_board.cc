#include "calib/detect_board.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "calib/corner_refine.h"
#include "calib/corner_search.h"
#include "calib/homography.h"
#include "core/check.h"
#include "core/error.h"

namespace mvstudio::calib {
namespace {

constexpr double kMaxPlaneErrorSquares = 0.35;  // median distance from the homography; strong lenses bend a board by less
constexpr double kMaxSmoothSigmaPx = 1.0;
constexpr double kMaxMisplaced =
    0.1;  // of the markers, but always one: a wrong layout may displace as few as one marker in every other row
constexpr char kMarkersMisplaced[] =
    "the markers do not lie as on the board (wrong size, or the layout: try with or without legacy)";
constexpr double kRejectSigmas = 8, kRejectFloorPx = 1.5;

Image ToGrey(const Image& image) {
  if (image.channels == 1) return image;
  Image grey(image.width, image.height, 1);
  for (size_t i = 0; i < grey.pixels.size(); ++i) {
    const uint8_t* rgb = image.pixels.data() + i * image.channels;
    grey.pixels[i] = static_cast<uint8_t>((rgb[0] * 4899 + rgb[1] * 9617 + rgb[2] * 1868 + 8192) >> 14);
  }
  return grey;
}

BoardDetection Failed(Status status, const std::string& reason) {
  BoardDetection result;
  result.status = status;
  result.reason = reason;
  return result;
}

Eigen::Vector2d OnBoard(const Board& board, int corner_id) { return {corner_id % board.cols, corner_id / board.cols}; }

/// Corners located so far: id, position, and the expected accuracy of the fit.
struct Located {
  std::vector<int> ids;
  std::vector<Eigen::Vector2d> px;
  std::vector<double> sigma_px, square_px;

  Eigen::Matrix2Xd Px() const {
    Eigen::Matrix2Xd points(2, px.size());
    for (size_t i = 0; i < px.size(); ++i) points.col(i) = px[i];
    return points;
  }
  Eigen::Matrix2Xd OnBoardPoints(const Board& board) const {
    Eigen::Matrix2Xd points(2, ids.size());
    for (size_t i = 0; i < ids.size(); ++i) points.col(i) = OnBoard(board, ids[i]);
    return points;
  }
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

/// Guesses of the corners not located yet, where the located ones say they should be.
std::vector<CornerGuess> GuessMissing(const Board& board, const Image& grey, const Located& located,
                                      const PlaneToImage& plane) {
  std::vector<CornerGuess> guesses;
  for (int id = 0; id < board.num_corners(); ++id) {
    if (std::find(located.ids.begin(), located.ids.end(), id) != located.ids.end()) continue;
    const Eigen::Vector2d at = OnBoard(board, id);
    double nearest = 1e9;
    for (int other : located.ids) nearest = std::min(nearest, (OnBoard(board, other) - at).norm());
    const Eigen::Vector2d px = plane(at);
    if (nearest > 1.5 || !px.allFinite() || px.x() < 0 || px.y() < 0 || px.x() > grey.width || px.y() > grey.height) continue;
    const auto step = [&](double x, double y) { return plane(at + Eigen::Vector2d(x, y)); };
    guesses.push_back({id, px, step(0.5, 0) - step(-0.5, 0), step(0, 0.5) - step(0, -0.5)});
  }
  return guesses;
}

std::string Describe(const char* format, double value) {
  char text[160];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

/// Keeps the corners that lie on the smooth image of a plane.
BoardDetection CheckCorners(const Board& board, const Located& located, const DetectOptions& options) {
  BoardDetection result;
  result.num_found = static_cast<int>(located.ids.size());
  const auto plane = PlaneToImage::Fit(located.OnBoardPoints(board), located.Px());
  if (!plane) return Failed(Status::kDegenerate, "the corners found lie on one line");
  const double square_px = Median(Eigen::Map<const Eigen::VectorXd>(located.square_px.data(), located.square_px.size()));
  if (plane->homography_median_px() > kMaxPlaneErrorSquares * square_px || plane->sigma_px() > kMaxSmoothSigmaPx) {
    return Failed(Status::kDegenerate,
                  Describe("the corners found do not lie on a plane (%.1f px off)", plane->homography_median_px()));
  }
  const double limit = std::max(kRejectFloorPx, kRejectSigmas * plane->sigma_px());
  std::vector<int> kept;
  for (int i = 0; i < result.num_found; ++i) {
    if (plane->residuals_px()[i] <= limit) kept.push_back(i);
  }
  if (static_cast<int>(kept.size()) < options.min_corners)
    return Failed(Status::kOutlier, "too few corners agree with a plane");
  result.detection.points_px.resize(2, kept.size());
  for (size_t k = 0; k < kept.size(); ++k) {
    result.detection.corner_ids.push_back(located.ids[kept[k]]);
    result.detection.points_px.col(k) = located.px[kept[k]];
  }
  return result;
}

}  // namespace

bool HasUniqueNumbering(const Board& board) {
  return board.kind == Board::Kind::kCharuco || (board.cols + board.rows) % 2 == 1;
}

BoardDetection DetectBoard(const Board& board, const Image& image, const DetectOptions& options) {
  MVS_CHECK(image.channels == 1 || image.channels == 3, image.channels << " channels");
  if (options.detector != "fast" && options.detector != "exact") {
    throw UsageError("detector '" + options.detector + "' is unknown: use fast or exact");
  }
  const Image grey = ToGrey(image);
  const bool charuco = board.kind == Board::Kind::kCharuco;
  CharucoSearch search;
  if (charuco) {
    search = SearchCharuco(board, grey);
    const int misplaced = search.num_markers - search.num_agreeing;
    if (misplaced > std::max(1.0, kMaxMisplaced * search.num_markers)) return Failed(Status::kDegenerate, kMarkersMisplaced);
  } else {
    search.guesses = SearchChessboard(board, grey, options.detector == "exact");
  }
  if (search.guesses.empty())
    return Failed(Status::kTooFewViews, charuco ? "no marker of the board found" : "no chessboard found");

  RefineOptions refine;
  refine.max_misfit = options.max_misfit;
  Located located;
  Locate(board, grey, search.guesses, refine, &located);
  if (located.ids.size() >= 6) {
    const auto plane = PlaneToImage::Fit(located.OnBoardPoints(board), located.Px());
    if (plane) Locate(board, grey, GuessMissing(board, grey, located, *plane), refine, &located);
  }
  const int needed = std::max(4, options.min_corners);
  if (static_cast<int>(located.ids.size()) < needed) {
    return Failed(Status::kOutlier,
                  "only " + std::to_string(located.ids.size()) + " sharp corners (" + std::to_string(needed) + " needed)");
  }
  return CheckCorners(board, located, options);
}

}  // namespace mvstudio::calib
