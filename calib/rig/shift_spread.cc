#include "calib/rig/shift_spread.h"

#include <algorithm>
#include <cmath>

#include "calib/rig/cheapest_path.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr double kNineOfTen = 0.9;

/// The board in both cameras.
struct BoardInBoth {
  Rigid3 in_a, in_b;
};

/// Boards that both see when b's frame f belongs to a's frame f + shift, thinned out to `max_frames`.
std::vector<BoardInBoth> SeenInBoth(const BoardPoses& a, const BoardPoses& b, int64_t shift, int max_frames) {
  std::vector<BoardInBoth> all;
  for (const auto& [key, b_from_board] : b) {
    const auto found = a.find({key.first + shift, key.second});
    if (found == a.end()) continue;
    all.push_back({found->second, b_from_board});
  }
  const auto limit = static_cast<size_t>(max_frames);
  if (all.size() <= limit) return all;
  std::vector<BoardInBoth> thin;
  for (size_t i = 0; i < limit; ++i) thin.push_back(all[i * all.size() / limit]);
  return thin;
}

/// Distances between the board and its transferred place over its distance, a row for each relative pose that some frame gives.
Eigen::MatrixXd DistancesByPose(const std::vector<BoardInBoth>& poses, const BoardTurns& turns) {
  constexpr size_t kCandidates = 25;
  const size_t count = std::min(kCandidates, poses.size()), num_turns = static_cast<size_t>(turns.num);
  Eigen::MatrixXd distances(count * num_turns, poses.size());
  for (size_t c = 0; c < count * num_turns; ++c) {
    const BoardInBoth& central = poses[c / num_turns * poses.size() / count];
    const Rigid3 a_from_b = turns.RelativePose(central.in_a, central.in_b, static_cast<int>(c % num_turns));
    for (size_t i = 0; i < poses.size(); ++i) {
      const Eigen::Vector3d& x_in_a = poses[i].in_a.translation;
      distances(static_cast<Eigen::Index>(c), static_cast<Eigen::Index>(i)) =
          (a_from_b * poses[i].in_b.translation - x_in_a).norm() / x_in_a.norm();
    }
  }
  return distances;
}

/// For the relative pose that has the least median.
ShiftSpread SpreadOfOne(const Eigen::MatrixXd& by_pose, int64_t shift) {
  ShiftSpread best{shift, static_cast<int>(by_pose.cols()), INFINITY, INFINITY};
  std::vector<double> distances(static_cast<size_t>(by_pose.cols()));
  for (Eigen::Index c = 0; c < by_pose.rows(); ++c) {
    for (Eigen::Index i = 0; i < by_pose.cols(); ++i) distances[static_cast<size_t>(i)] = by_pose(c, i);
    const double median = UpperMedian(distances.begin(), distances.end());
    if (median < best.spread) best.spread = median, best.most = UpperQuantile(distances, kNineOfTen);
  }
  return best;
}

/// For the cheapest sequence of relative poses; that of one pose where it has short parts or many.
ShiftSpread SpreadOfSeveral(const Eigen::MatrixXd& by_pose, int64_t shift) {
  constexpr double kSigma = 0.005, kMoveNats = 20;
  constexpr size_t kLeastPart = 8, kMostParts = 3;
  const Eigen::MatrixXd nats = by_pose.unaryExpr([](double d) { return RobustNats(d, kSigma); });
  const std::vector<int> state = FindCheapestPath(nats, kMoveNats).state;
  std::vector<std::vector<double>> parts;
  std::vector<double> all;
  for (size_t i = 0; i < state.size(); ++i) {
    if (i == 0 || state[i] != state[i - 1]) parts.emplace_back();
    all.push_back(by_pose(state[i], static_cast<Eigen::Index>(i)));
    parts.back().push_back(all.back());
  }
  const auto is_short = [](const std::vector<double>& part) { return part.size() < kLeastPart; };
  if (parts.size() > kMostParts || std::any_of(parts.begin(), parts.end(), is_short)) return SpreadOfOne(by_pose, shift);
  ShiftSpread spread{shift, static_cast<int>(by_pose.cols()), UpperMedian(std::move(all)), 0};
  for (std::vector<double>& part : parts) spread.most = std::max(spread.most, UpperQuantile(std::move(part), kNineOfTen));
  return spread;
}

}  // namespace

std::vector<ShiftSpread> ScanShifts(const BoardPoses& a, const BoardPoses& b, RelativePoses poses,
                                    const FrameOffsetOptions& options) {
  std::vector<ShiftSpread> scan;
  int most = 0;
  for (int64_t shift = -options.max_shift; shift <= options.max_shift; ++shift) {
    const std::vector<BoardInBoth> shared = SeenInBoth(a, b, shift, options.max_frames);
    const auto n = static_cast<int>(shared.size());
    if (n < options.min_shared) continue;
    most = std::max(most, n);
    const Eigen::MatrixXd by_pose = DistancesByPose(shared, options.turns);
    scan.push_back(poses == RelativePoses::kOne ? SpreadOfOne(by_pose, shift) : SpreadOfSeveral(by_pose, shift));
  }
  const auto few = [&](const ShiftSpread& s) { return s.num_shared < most / 3; };
  scan.erase(std::remove_if(scan.begin(), scan.end(), few), scan.end());
  return scan;
}

}  // namespace mvstudio::calib
