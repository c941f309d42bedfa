#include "calib/detect/board_surface.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

constexpr size_t kInnerCorners = 20;  // of a piece, which it judges: those near to its middle
constexpr double kRejectSigmas = 8, kRejectFloorPx = 1.5;
constexpr double kSmoothShare = 0.7;  // of its corners that a piece holds, or it may lie across a jump

/// The positions in `among`, nearest to `at` first, not more than a piece has.
std::vector<Eigen::Index> Nearest(const Eigen::Matrix2Xd& on_board, const Eigen::Vector2d& at,
                                  std::vector<Eigen::Index> among) {
  const size_t count = std::min(kPieceCorners, among.size());
  const auto nearer = [&](Eigen::Index a, Eigen::Index b) {
    const double da = (on_board.col(a) - at).squaredNorm(), db = (on_board.col(b) - at).squaredNorm();
    return da < db || (da == db && a < b);
  };
  std::partial_sort(among.begin(), among.begin() + static_cast<std::ptrdiff_t>(count), among.end(), nearer);
  among.resize(count);
  return among;
}

struct Piece {
  std::vector<Eigen::Index> corners;  // nearest to the middle first
  PlaneToImage plane;
};

/// Pieces that judge every corner at least once; none when some of them lie on one line.
std::vector<Piece> CoverWithPieces(const Eigen::Matrix2Xd& on_board, const Eigen::Matrix2Xd& px) {
  std::vector<Eigen::Index> all(static_cast<size_t>(px.cols()));
  std::iota(all.begin(), all.end(), 0);
  std::vector<bool> judged(all.size(), false);
  std::vector<Piece> pieces;
  for (const Eigen::Index middle : all) {
    if (judged[static_cast<size_t>(middle)]) continue;
    std::vector<Eigen::Index> corners = all.size() > kPieceCorners ? Nearest(on_board, on_board.col(middle), all) : all;
    const auto plane = PlaneToImage::Fit(on_board(Eigen::all, corners), px(Eigen::all, corners));
    if (!plane) return {};
    const size_t inner = all.size() > kPieceCorners ? kInnerCorners : corners.size();
    for (size_t k = 0; k < inner; ++k) judged[static_cast<size_t>(corners[k])] = true;
    pieces.push_back({std::move(corners), *plane});
  }
  return pieces;
}

/// Sets of corners that pieces join.
class Joined {
 public:
  explicit Joined(size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), size_t{0}); }
  size_t RootOf(size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void Join(size_t a, size_t b) { parent_[RootOf(a)] = RootOf(b); }
  size_t LargestRoot() {
    std::vector<int> sizes(parent_.size(), 0);
    for (size_t i = 0; i < parent_.size(); ++i) ++sizes[RootOf(i)];
    return static_cast<size_t>(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  }

 private:
  std::vector<size_t> parent_;
};

/// Per corner: the distance from the piece to whose middle it is nearest.
std::vector<double> Residuals(const std::vector<Piece>& pieces, size_t num_corners) {
  std::vector<double> residuals(num_corners, std::numeric_limits<double>::infinity());
  std::vector<size_t> ranks(num_corners, std::numeric_limits<size_t>::max());
  for (const Piece& piece : pieces) {
    for (size_t k = 0; k < piece.corners.size(); ++k) {
      const auto corner = static_cast<size_t>(piece.corners[k]);
      if (k >= ranks[corner]) continue;
      ranks[corner] = k;
      residuals[corner] = piece.plane.residuals_px()[static_cast<Eigen::Index>(k)];
    }
  }
  return residuals;
}

std::vector<bool> Held(const std::vector<Piece>& pieces, size_t num_corners, double limit_px) {
  const std::vector<double> residuals = Residuals(pieces, num_corners);
  std::vector<bool> held(num_corners);
  for (size_t i = 0; i < num_corners; ++i) held[i] = residuals[i] <= limit_px;
  if (pieces.size() == 1) return held;
  Joined joined(num_corners);
  for (const Piece& piece : pieces) {
    std::vector<size_t> fitting;
    for (size_t k = 0; k < piece.corners.size(); ++k) {
      if (piece.plane.residuals_px()[static_cast<Eigen::Index>(k)] <= limit_px) {
        fitting.push_back(static_cast<size_t>(piece.corners[k]));
      }
    }
    if (static_cast<double>(fitting.size()) < kSmoothShare * static_cast<double>(piece.corners.size())) continue;
    for (const size_t corner : fitting) joined.Join(corner, fitting[0]);
  }
  const size_t largest = joined.RootOf(joined.LargestRoot());
  for (size_t i = 0; i < num_corners; ++i) held[i] = held[i] && joined.RootOf(i) == largest;
  return held;
}

}  // namespace

std::optional<PlaneToImage> PlaneAround(const Located& located, const Eigen::Vector2d& at,
                                        const std::vector<Eigen::Index>& among) {
  const Eigen::Matrix2Xd on_board = located.OnBoard(), px = located.Px();
  const std::vector<Eigen::Index> near = among.size() > kPieceCorners ? Nearest(on_board, at, among) : among;
  return PlaneToImage::Fit(on_board(Eigen::all, near), px(Eigen::all, near));
}

BoardSurface FitSurface(const Located& located) {
  BoardSurface surface;
  const std::vector<Piece> pieces = CoverWithPieces(located.OnBoard(), located.Px());
  surface.on_one_line = pieces.empty();
  if (surface.on_one_line) return surface;
  std::vector<double> sigmas;
  for (const Piece& piece : pieces) {
    std::vector<double> squares;
    for (const Eigen::Index corner : piece.corners) squares.push_back(located.square_px[static_cast<size_t>(corner)]);
    const double off_px = piece.plane.homography_median_px(), off_squares = off_px / UpperMedian(squares);
    if (off_squares >= surface.off_squares) surface.off_squares = off_squares, surface.off_px = off_px;
    sigmas.push_back(piece.plane.sigma_px());
  }
  surface.sigma_px = UpperMedian(sigmas);
  const double limit_px = std::max(kRejectFloorPx, kRejectSigmas * surface.sigma_px);
  surface.held = Held(pieces, located.ids.size(), limit_px);
  return surface;
}

}  // namespace mvstudio::calib
