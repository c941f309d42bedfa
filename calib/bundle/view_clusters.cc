#include "calib/bundle/view_clusters.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

constexpr double kSamePlace = 0.05;  // of the board's size in the image
constexpr int kSampled = 9;          // corners that are compared
constexpr int kMinCommon = 3;

/// Where a view that began a cluster has its corners, by their numbers.
struct Leader {
  std::vector<Eigen::Vector2d> px;  // NaN where there is none
  double size_px = 0;
  int cluster = 0;
};

Leader MakeLeader(const View& view, int cluster) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  Leader leader;
  leader.cluster = cluster;
  for (Eigen::Index i = 0; i < view.size(); ++i) {
    const auto id = static_cast<size_t>(view.corner_ids[i]);
    if (id >= leader.px.size()) leader.px.resize(id + 1, Eigen::Vector2d(kNan, kNan));
    leader.px[id] = view.px.col(i);
  }
  if (view.size() > 0) leader.size_px = (view.px.rowwise().maxCoeff() - view.px.rowwise().minCoeff()).norm();
  return leader;
}

bool SamePlace(const Leader& leader, const View& view) {
  std::vector<double> moved;
  const Eigen::Index step = std::max<Eigen::Index>(1, view.size() / kSampled);
  for (Eigen::Index i = 0; i < view.size(); i += step) {
    const auto id = static_cast<size_t>(view.corner_ids[i]);
    const double distance = id < leader.px.size() ? (view.px.col(i) - leader.px[id]).norm() : std::nan("");
    if (std::isfinite(distance)) moved.push_back(distance);
  }
  return static_cast<int>(moved.size()) >= kMinCommon && UpperMedian(std::move(moved)) < kSamePlace * leader.size_px;
}

}  // namespace

std::vector<int> ClusterViews(const std::vector<View>& views) {
  std::map<std::pair<int, int>, std::vector<Leader>> leaders;  // by camera and board
  std::vector<int> clusters;
  int next = 0;
  for (const View& view : views) {
    std::vector<Leader>& own = leaders[{view.camera_idx, view.board}];
    const auto found = std::find_if(own.rbegin(), own.rend(), [&](const Leader& leader) { return SamePlace(leader, view); });
    const bool is_new = found == own.rend();
    if (is_new) own.push_back(MakeLeader(view, next));
    clusters.push_back(is_new ? next++ : found->cluster);
  }
  return clusters;
}

std::vector<int> ClusterFrames(const std::vector<View>& views, const std::vector<int>& cluster_of_view, size_t num_frames) {
  std::vector<std::map<std::pair<int, int>, int>> observations(num_frames);  // per frame: cluster by camera and board
  for (size_t v = 0; v < views.size(); ++v) {
    if ((views[v].weights.array() > 0).any())
      observations[views[v].frame][{views[v].camera_idx, views[v].board}] = cluster_of_view[v];
  }
  std::vector<int> clusters(num_frames, -1);
  std::map<int, std::vector<size_t>> leaders;  // by cluster of a view: first frames that have it
  int next = 0;
  for (size_t f = 0; f < num_frames; ++f) {
    for (const auto& [key, cluster] : observations[f]) {
      for (const size_t leader : leaders[cluster]) {
        int same = 0, other = 0;
        for (const auto& [leader_key, leader_cluster] : observations[leader]) {
          const auto found = observations[f].find(leader_key);
          if (found != observations[f].end()) (found->second == leader_cluster ? same : other)++;
        }
        if (clusters[f] < 0 && same > other) clusters[f] = clusters[leader];
      }
    }
    if (clusters[f] >= 0 || observations[f].empty()) continue;
    clusters[f] = next++;
    for (const auto& [key, cluster] : observations[f]) leaders[cluster].push_back(f);
  }
  return clusters;
}

int CountClusters(const std::vector<int>& clusters) {
  std::vector<int> sorted;
  std::copy_if(clusters.begin(), clusters.end(), std::back_inserter(sorted), [](int cluster) { return cluster >= 0; });
  std::sort(sorted.begin(), sorted.end());
  return static_cast<int>(std::unique(sorted.begin(), sorted.end()) - sorted.begin());
}

std::vector<double> RepeatCorrelation(const std::vector<View>& views, const std::vector<int>& cluster_of_frame,
                                      const std::vector<Eigen::Matrix2Xd>& residuals, size_t num_cameras) {
  struct Sums {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double squares = 0;
    int count = 0;
  };
  std::map<std::tuple<int, int, int, int>, Sums> repeats;  // camera, board, cluster, corner
  for (size_t v = 0; v < views.size(); ++v) {
    const View& view = views[v];
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      if (view.weights[i] <= 0) continue;
      Sums& sums = repeats[{view.camera_idx, view.board, cluster_of_frame[view.frame], view.corner_ids[i]}];
      const Eigen::Vector2d r = std::sqrt(view.weights[i]) * residuals[v].col(i);
      sums.sum += r, sums.squares += r.squaredNorm(), ++sums.count;
    }
  }
  std::vector<double> products(num_cameras, 0), pairs(num_cameras, 0), squares(num_cameras, 0), counts(num_cameras, 0);
  for (const auto& [key, sums] : repeats) {
    if (sums.count < 2) continue;
    const int c = std::get<0>(key);
    const double n = sums.count;
    products[c] += (sums.sum.squaredNorm() - sums.squares) / n, pairs[c] += n - 1;
    squares[c] += sums.squares, counts[c] += n;
  }
  std::vector<double> correlation;
  for (size_t c = 0; c < num_cameras; ++c) {
    const double mean_square = squares[c] / std::max(1.0, counts[c]);
    correlation.push_back(pairs[c] > 0 && mean_square > 0 ? std::clamp(products[c] / pairs[c] / mean_square, 0.0, 1.0) : 0);
  }
  return correlation;
}

std::vector<View> DiscountRepeats(const std::vector<View>& views, const std::vector<int>& cluster_of_frame,
                                  const std::vector<double>& correlation) {
  std::map<std::tuple<int, int, int>, int> count;
  const auto key = [&](const View& view) { return std::make_tuple(view.camera_idx, view.board, cluster_of_frame[view.frame]); };
  for (const View& view : views) count[key(view)] += (view.weights.array() > 0).any();
  std::vector<View> discounted = views;
  for (View& view : discounted) {
    if ((view.weights.array() > 0).any()) view.weights /= 1 + (count[key(view)] - 1) * correlation[view.camera_idx];
  }
  return discounted;
}

}  // namespace mvstudio::calib
