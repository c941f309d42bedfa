#include "calib/lens/gross_errors.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/board/homography.h"
#include "core/random.h"

namespace mvstudio::calib {
namespace {

constexpr int kSamples = 300;           // half of the corners wrong: 1 in 16 is clean
constexpr double kTolerance = 0.04;     // of the board's diagonal in the image
constexpr double kMinTolerancePx = 2;
constexpr double kMinAgree = 0.25;      // share of the corners
constexpr int kRefinements = 4;

struct Points {
  Eigen::Matrix2Xd in_plane, px;
  std::vector<Eigen::Index> index;  // into the view
};

Points WeightedPoints(const View& view) {
  Points points{Eigen::Matrix2Xd(2, view.size()), Eigen::Matrix2Xd(2, view.size()), {}};
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    if (view.weights[i] <= 0) continue;
    const auto n = static_cast<Eigen::Index>(points.index.size());
    points.in_plane.col(n) = view.x_in_board.col(i).head<2>();
    points.px.col(n) = view.px.col(i);
    points.index.push_back(i);
  }
  const auto n = static_cast<Eigen::Index>(points.index.size());
  points.in_plane.conservativeResize(2, n), points.px.conservativeResize(2, n);
  return points;
}

Points Select(const Points& points, const std::vector<bool>& keep) {
  Points chosen = points;
  chosen.index.clear();
  Eigen::Index n = 0;
  for (size_t i = 0; i < keep.size(); ++i) {
    if (!keep[i]) continue;
    chosen.in_plane.col(n) = points.in_plane.col(static_cast<Eigen::Index>(i));
    chosen.px.col(n++) = points.px.col(static_cast<Eigen::Index>(i));
    chosen.index.push_back(points.index[i]);
  }
  chosen.in_plane.conservativeResize(2, n), chosen.px.conservativeResize(2, n);
  return chosen;
}

/// Length in the image of the diagonal of the corners' bounding box.
double DiagonalPx(const Points& points, const Eigen::Matrix3d& homography) {
  const Eigen::Vector2d low = points.in_plane.rowwise().minCoeff(), high = points.in_plane.rowwise().maxCoeff();
  return std::max((MapPoint(homography, high) - MapPoint(homography, low)).norm(),
                  (MapPoint(homography, {low.x(), high.y()}) - MapPoint(homography, {high.x(), low.y()})).norm());
}

/// Median distance of the corners from their middle: half a board's diagonal or, with wrong corners, of the image at most.
double SpreadPx(const Points& points) {
  const Eigen::Vector2d middle(Median(points.px.row(0)), Median(points.px.row(1)));
  return Median((points.px.colwise() - middle).colwise().norm());
}

double TolerancePx(double diagonal_px) { return std::max(kMinTolerancePx, kTolerance * diagonal_px); }

/// Squared distances in units of the tolerance, at most 1 each: small is good.
template <class Map>
double Score(const Points& points, const Map& map, double tolerance_px, std::vector<bool>* agrees) {
  double score = 0;
  agrees->assign(points.index.size(), false);
  for (size_t i = 0; i < points.index.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const double distance = (map(points.in_plane.col(k)) - points.px.col(k)).norm() / tolerance_px;
    (*agrees)[i] = distance < 1;
    score += distance < 1 ? distance * distance : 1;
  }
  return score;
}

/// The homography maps the whole board in front of the camera: its denominator keeps its sign over the corners.
bool KeepsSide(const Eigen::Matrix3d& homography, const Points& points) {
  const Eigen::RowVectorXd side = homography.row(2) * points.in_plane.colwise().homogeneous();
  return side.minCoeff() * side.maxCoeff() > 0;
}

struct Consensus {
  std::vector<bool> agrees;
  double tolerance_px = 0;
};

Consensus SampleConsensus(const Points& points) {
  Rng rng(1);
  const auto n = static_cast<int64_t>(points.index.size());
  const double largest_diagonal = 3 * SpreadPx(points);
  Consensus best;
  std::vector<bool> agrees;
  double best_score = std::numeric_limits<double>::infinity();
  for (int sample = 0; sample < kSamples; ++sample) {
    Eigen::Matrix<double, 2, 4> from, to;
    int64_t chosen[4];
    for (int i = 0; i < 4;) {
      chosen[i] = rng.Index(n);
      if (std::find(chosen, chosen + i, chosen[i]) != chosen + i) continue;
      from.col(i) = points.in_plane.col(chosen[i]), to.col(i) = points.px.col(chosen[i]);
      ++i;
    }
    const auto homography = FitHomography(from, to);
    if (!homography || !KeepsSide(*homography, points)) continue;
    const double tolerance = TolerancePx(std::min(largest_diagonal, DiagonalPx(points, *homography)));
    const double score = Score(points, [&](const Eigen::Vector2d& x) { return MapPoint(*homography, x); }, tolerance, &agrees);
    if (score < best_score) best_score = score, best = {agrees, tolerance};
  }
  return best;
}

double Share(const std::vector<bool>& flags) {
  return static_cast<double>(std::count(flags.begin(), flags.end(), true)) / std::max<double>(1, static_cast<double>(flags.size()));
}

/// Whether one smooth image explains all corners.
bool AllAgree(const Points& points) {
  const auto fit = PlaneToImage::Fit(points.in_plane, points.px);
  const auto homography = FitHomography(points.in_plane, points.px);
  if (!fit || !homography) return false;
  const double diagonal = std::min(3 * SpreadPx(points), DiagonalPx(points, *homography));
  return fit->residuals_px().maxCoeff() < TolerancePx(diagonal);
}

}  // namespace

int ScreenView(View* view) {
  const Points points = WeightedPoints(*view);
  if (points.index.size() < 6 || !points.px.allFinite() || AllAgree(points)) return 0;
  Consensus consensus = SampleConsensus(points);
  if (Share(consensus.agrees) < kMinAgree) return 0;
  for (int i = 0; i < kRefinements; ++i) {  // a lens bends the image of the plane: those that the homography missed come back
    const Points good = Select(points, consensus.agrees);
    const auto fit = PlaneToImage::Fit(good.in_plane, good.px);
    std::vector<bool> next;
    if (!fit) break;
    Score(points, *fit, consensus.tolerance_px, &next);
    if (Share(next) < kMinAgree || next == consensus.agrees) break;
    consensus.agrees = next;
  }
  int lost = 0;
  for (size_t i = 0; i < consensus.agrees.size(); ++i) {
    if (!consensus.agrees[i]) view->weights[points.index[i]] = 0, ++lost;
  }
  return lost;
}

}  // namespace mvstudio::calib
