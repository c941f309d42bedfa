#include <algorithm>
#include <cmath>

#include "calib/detect/circle_refine.h"
#include "calib/detect/locate_board.h"
#include "core/format.h"

namespace mvstudio::calib {
namespace {

/// Px from a circle to its nearest neighbour.
double NearestPx(const Eigen::Matrix2Xd& px, Eigen::Index at) {
  double nearest = 1e9;
  for (Eigen::Index i = 0; i < px.cols(); ++i) {
    if (i != at) nearest = std::min(nearest, (px.col(i) - px.col(at)).norm());
  }
  return nearest;
}

BoardDetection FitCircles(const Board& board, const Image& grey, const std::vector<Spot>& seen, const std::vector<int>& circles,
                          const DetectOptions& options) {
  Located located(board);
  std::vector<Spot> spots;
  for (int id = 0; id < board.num_corners(); ++id) {
    const FittedSpot fitted = FitSpot(grey, seen[static_cast<size_t>(circles[static_cast<size_t>(id)])], options.max_misfit);
    if (fitted.status != Status::kOk) continue;
    located.ids.push_back(id);
    located.sigma_px.push_back(fitted.sigma_px);
    spots.push_back(fitted.spot);
  }
  const int needed = std::max(6, std::min(options.min_corners, board.num_corners()));
  if (static_cast<int>(spots.size()) < needed)
    return NotDetected(Status::kOutlier, Format("only %zu sharp circles (%d needed)", spots.size(), needed));
  const Eigen::Matrix2Xd on_board = CornersInBoard(board).topRows<2>()(Eigen::all, located.ids);
  const Eigen::Matrix2Xd centres = CentresSeen(on_board, spots);
  for (Eigen::Index i = 0; i < centres.cols(); ++i) {
    located.px.push_back(centres.col(i));
    located.square_px.push_back(NearestPx(centres, i));
  }
  return CheckLocated(board, located, options);
}

}  // namespace

BoardDetection DetectCircleGrid(const Board& board, const Image& grey, const DetectOptions& options) {
  const std::vector<Spot> seen = FindSpots(grey);
  const std::vector<SpotLattice> lattices = FindLattices(seen);
  std::vector<int> circles;
  for (size_t l = 0; l < lattices.size() && circles.empty(); ++l) circles = CirclesInLattice(board, lattices[l], seen);
  if (circles.empty()) {
    if (lattices.empty()) return NotDetected(Status::kTooFewViews, "no grid of circles found");
    const bool fewer = lattices[0].size() < static_cast<size_t>(board.num_corners());
    return NotDetected(Status::kDegenerate, fewer ? "not all circles of the board are in sight, or it has fewer"
                                                  : "the circles in sight are more than the board's, or in other rows");
  }
  return SharpAndSoft(options, circles.size(),
                      [&](const DetectOptions& limited) { return FitCircles(board, grey, seen, circles, limited); });
}

}  // namespace mvstudio::calib
