#include "calib/detect/locate_board.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "calib/detect/board_surface.h"
#include "core/format.h"

namespace mvstudio::calib {
namespace {

constexpr double kMaxPlaneErrorSquares =
    0.35;  // median distance from a homography in a piece; strong lenses distort it by less
constexpr double kMaxSmoothSigmaPx = 1.0;
constexpr int kGrowRounds = 8;  // from tags that were found to their neighbours

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
  if (line.empty() || line.size() > kFewInLine || others.size() < kEnoughOthers) return loose;
  const auto plane = PlaneAround(located, on_board(Eigen::all, line).rowwise().mean(), others);
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
std::vector<CornerGuess> GuessMissing(const Image& grey, const Located& located) {
  std::vector<CornerGuess> guesses;
  std::vector<Eigen::Index> all(located.ids.size());
  std::iota(all.begin(), all.end(), 0);
  std::optional<PlaneToImage> plane;
  for (int id = 0; id < located.on_board.cols(); ++id) {
    if (located.Has(id)) continue;
    const Eigen::Vector2d at = located.on_board.col(id);
    double nearest = 1e9;
    for (int other : located.ids) nearest = std::min(nearest, (located.on_board.col(other) - at).norm());
    if (nearest > 1.5) continue;
    if (!plane || all.size() > kPieceCorners) plane = PlaneAround(located, at, all);
    if (!plane) continue;
    const Eigen::Vector2d px = (*plane)(at);
    if (!px.allFinite() || px.x() < 0 || px.y() < 0 || px.x() > grey.width || px.y() > grey.height) continue;
    const auto step = [&](double x, double y) { return (*plane)(at + Eigen::Vector2d(x, y)); };
    guesses.push_back({id, px, step(0.5, 0) - step(-0.5, 0), step(0, 0.5) - step(0, -0.5)});
  }
  return guesses;
}

int NeededCorners(const Board& board, const DetectOptions& options) {
  return std::max(4, std::min(options.min_corners, board.num_corners()));
}

}  // namespace

BoardDetection NotDetected(Status status, const std::string& reason) {
  BoardDetection result;
  result.status = status;
  result.reason = reason;
  return result;
}

BoardDetection CheckLocated(const Board& board, const Located& located, const DetectOptions& options) {
  BoardDetection result;
  result.num_found = static_cast<int>(located.ids.size());
  const BoardSurface surface = FitSurface(located);
  if (surface.on_one_line) return NotDetected(Status::kDegenerate, "the corners found lie on one line");
  result.sigma_px = surface.sigma_px;
  if (surface.off_squares > kMaxPlaneErrorSquares || surface.sigma_px > kMaxSmoothSigmaPx) {
    return NotDetected(Status::kDegenerate, Format("the corners found do not lie on a plane (%.1f px off)", surface.off_px));
  }
  std::vector<int> kept;
  for (int i = 0; i < result.num_found; ++i) {
    if (surface.held[static_cast<size_t>(i)]) kept.push_back(i);
  }
  if (static_cast<int>(kept.size()) < NeededCorners(board, options))
    return NotDetected(Status::kOutlier, "too few corners agree with a plane");
  result.detection.points_px.resize(2, kept.size());
  for (size_t k = 0; k < kept.size(); ++k) {
    result.detection.corner_ids.push_back(located.ids[kept[k]]);
    result.detection.points_px.col(k) = located.px[kept[k]];
  }
  return result;
}

BoardDetection SharpAndSoft(const DetectOptions& options, size_t num_guesses,
                            const std::function<BoardDetection(const DetectOptions&)>& locate) {
  constexpr int kEnoughToCheck = 8;  // corners that a smooth image of a plane judges
  if (options.max_misfit > 0) return locate(options);
  DetectOptions limited = options;
  limited.max_misfit = kSharpMisfit;
  BoardDetection sharp = locate(limited);
  const auto count = [](const BoardDetection& d) { return d.status == Status::kOk ? d.detection.num_corners() : 0; };
  if (2 * static_cast<size_t>(count(sharp)) >= num_guesses) return sharp;
  limited.max_misfit = kSoftMisfit;
  BoardDetection soft = locate(limited);
  if (count(soft) >= kEnoughToCheck && count(soft) > 2 * count(sharp)) sharp.soft.push_back(std::move(soft));
  return sharp;
}

namespace {

BoardDetection LocateWithin(const Board& board, const Image& grey, const std::vector<CornerGuess>& guesses,
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
    Locate(board, grey, GuessMissing(grey, located), refine, &located);
  }
  DropLoose(&located);
  const int needed = NeededCorners(board, options);
  if (static_cast<int>(located.ids.size()) < needed) {
    return NotDetected(Status::kOutlier,
                       "only " + std::to_string(located.ids.size()) + " sharp corners (" + std::to_string(needed) + " needed)");
  }
  return CheckLocated(board, located, options);
}

}  // namespace

BoardDetection LocateBoard(const Board& board, const Image& grey, const std::vector<CornerGuess>& guesses,
                           const DetectOptions& options) {
  return SharpAndSoft(options, guesses.size(),
                      [&](const DetectOptions& limited) { return LocateWithin(board, grey, guesses, limited); });
}

}  // namespace mvstudio::calib
