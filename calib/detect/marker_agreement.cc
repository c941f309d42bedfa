#include "calib/detect/marker_agreement.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/calib3d.hpp>

#include "calib/board/homography.h"

namespace mvstudio::calib {
namespace {

constexpr double kMaxOffDiagonals = 0.35;  // of a marker from where it is predicted
constexpr double kLeastLimitPx = 2;
constexpr double kNeighbourSteps = 1.6;  // times the usual distance of a marker to the nearest one
constexpr size_t kNearMarkers = 8;       // that predict another

Eigen::Vector2d CentreOnBoard(const Marker& marker) { return marker.on_board.rowwise().mean(); }

double BoardDistance(const Marker& a, const Marker& b) { return (CentreOnBoard(a) - CentreOnBoard(b)).norm(); }

double LimitPx(double diagonal_px) { return std::max(kLeastLimitPx, kMaxOffDiagonals * diagonal_px); }

/// Derivative of the image position with respect to the board position, from a marker's four corners.
Eigen::Matrix2d Slope(const Marker& marker) {
  const Eigen::Matrix<double, 2, 4> px = marker.px.colwise() - marker.px.rowwise().mean();
  const Eigen::Matrix<double, 2, 4> on_board = marker.on_board.colwise() - marker.on_board.rowwise().mean();
  return px * on_board.transpose() * (on_board * on_board.transpose()).inverse();
}

/// Whether two markers lie as far from each other as the mean of their slopes says.
bool LieTogether(const Marker& a, const Marker& b) {
  const Eigen::Vector2d step_px = b.px.rowwise().mean() - a.px.rowwise().mean();
  const Eigen::Vector2d predicted_px = (Slope(a) + Slope(b)) / 2 * (CentreOnBoard(b) - CentreOnBoard(a));
  const auto diagonal = [](const Marker& m) { return (m.px.col(0) - m.px.col(2)).norm(); };
  return (step_px - predicted_px).norm() <= LimitPx(std::min(diagonal(a), diagonal(b)));
}

/// The usual distance on the board from a marker to the nearest other one.
double MarkerStep(const std::vector<Marker>& markers) {
  Eigen::VectorXd nearest = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(markers.size()), 1e9);
  for (size_t i = 0; i < markers.size(); ++i) {
    for (size_t j = 0; j < markers.size(); ++j) {
      if (j != i)
        nearest[static_cast<Eigen::Index>(i)] =
            std::min(nearest[static_cast<Eigen::Index>(i)], BoardDistance(markers[i], markers[j]));
    }
  }
  return Median(nearest);
}

std::ptrdiff_t Count(const std::vector<bool>& flags) { return std::count(flags.begin(), flags.end(), true); }

/// The largest set of markers that can be reached from one another through neighbours that lie together.
std::vector<bool> LargestPatch(const std::vector<Marker>& markers) {
  const double reach = kNeighbourSteps * MarkerStep(markers);
  std::vector<bool> seen(markers.size(), false), largest(markers.size(), false);
  for (size_t first = 0; first < markers.size(); ++first) {
    if (seen[first]) continue;
    std::vector<bool> patch(markers.size(), false);
    std::vector<size_t> open = {first};
    seen[first] = true;
    while (!open.empty()) {
      const size_t i = open.back();
      open.pop_back();
      patch[i] = true;
      for (size_t j = 0; j < markers.size(); ++j) {
        if (seen[j] || BoardDistance(markers[i], markers[j]) > reach || !LieTogether(markers[i], markers[j])) continue;
        seen[j] = true;
        open.push_back(j);
      }
    }
    if (Count(patch) > Count(largest)) largest = patch;
  }
  return largest;
}

/// Markers of which 3 corners lie on one homography. It finds those of a board of which a few markers are seen, far apart.
std::vector<bool> OnOneHomography(const std::vector<Marker>& markers) {
  std::vector<cv::Point2f> from, to;
  double diagonal_px = 0;
  for (const Marker& m : markers) {
    for (int k = 0; k < 4; ++k) from.emplace_back(m.on_board(0, k), m.on_board(1, k)), to.emplace_back(m.px(0, k), m.px(1, k));
    diagonal_px += (m.px.col(0) - m.px.col(2)).norm() / static_cast<double>(markers.size());
  }
  std::vector<bool> agreeing(markers.size(), false);
  cv::setRNGSeed(1);
  cv::Mat mask;
  if (cv::findHomography(from, to, cv::RANSAC, LimitPx(diagonal_px), mask, 500).empty()) return agreeing;
  for (size_t i = 0; i < markers.size(); ++i) {
    int votes = 0;
    for (int k = 0; k < 4; ++k) votes += mask.at<uint8_t>(static_cast<int>(4 * i + static_cast<size_t>(k))) != 0;
    agreeing[i] = votes >= 3;
  }
  return agreeing;
}

/// Whether 3 corners of a marker lie where `predict` says.
template <class Predict>
bool LiesAs(const Marker& marker, const Predict& predict) {
  const double limit = LimitPx((predict(marker.on_board.col(0)) - predict(marker.on_board.col(2))).norm());
  int votes = 0;
  for (int k = 0; k < 4; ++k) votes += (predict(marker.on_board.col(k)) - marker.px.col(k)).norm() <= limit;
  return votes >= 3;
}

/// Board and image positions (2, 4 N) of the corners of markers.
struct MarkerCorners {
  explicit MarkerCorners(const std::vector<Marker>& of) : on_board(2, 4 * of.size()), px(2, 4 * of.size()) {
    for (size_t i = 0; i < of.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(4 * i);
      on_board.middleCols<4>(at) = of[i].on_board, px.middleCols<4>(at) = of[i].px;
    }
  }
  Eigen::Matrix2Xd on_board, px;
};

/// Whether a marker lies where the nearest ones of `agreeing` predict it.
bool LiesAsNeighbours(const Marker& marker, std::vector<Marker> agreeing) {
  const size_t near = std::min(kNearMarkers, agreeing.size());
  std::partial_sort(agreeing.begin(), agreeing.begin() + static_cast<std::ptrdiff_t>(near), agreeing.end(),
                    [&](const Marker& a, const Marker& b) { return BoardDistance(a, marker) < BoardDistance(b, marker); });
  agreeing.resize(near);
  const MarkerCorners corners(agreeing);
  const auto homography = FitHomography(corners.on_board, corners.px);
  return homography && LiesAs(marker, [&](const Eigen::Vector2d& at) { return MapPoint(*homography, at); });
}

std::vector<Marker> Chosen(const std::vector<Marker>& markers, const std::vector<bool>& chosen) {
  std::vector<Marker> kept;
  for (size_t i = 0; i < markers.size(); ++i) {
    if (chosen[i]) kept.push_back(markers[i]);
  }
  return kept;
}

/// The markers that lie as those of `agreeing`, which stay.
std::vector<bool> Grown(const std::vector<Marker>& markers, const std::vector<bool>& agreeing) {
  const std::vector<Marker> core = Chosen(markers, agreeing);
  const MarkerCorners corners(core);
  const auto plane = PlaneToImage::Fit(corners.on_board, corners.px);
  std::vector<bool> grown = agreeing;
  for (size_t i = 0; i < markers.size(); ++i) {
    if (!grown[i]) grown[i] = LiesAsNeighbours(markers[i], core) || (plane && LiesAs(markers[i], *plane));
  }
  return grown;
}

}  // namespace

std::vector<Marker> AgreeingMarkers(const std::vector<Marker>& markers) {
  if (markers.empty()) return markers;
  const std::vector<bool> flat = OnOneHomography(markers), patch = LargestPatch(markers);
  std::vector<bool> agreeing = Count(patch) > Count(flat) ? patch : flat;
  while (Count(agreeing) >= 3 && Count(agreeing) < static_cast<std::ptrdiff_t>(markers.size())) {
    const std::vector<bool> grown = Grown(markers, agreeing);
    if (Count(grown) == Count(agreeing)) break;
    agreeing = grown;
  }
  return Chosen(markers, agreeing);
}

}  // namespace mvstudio::calib
