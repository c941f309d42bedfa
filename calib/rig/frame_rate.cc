#include "calib/rig/frame_rate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr int64_t kMostOffset = 60;
constexpr size_t kLeastShared = 12, kMostShared = 60;

/// The board in both cameras at one moment.
struct Sighting {
  Rigid3 in_a, in_b;
};

std::vector<Sighting> SharedSightings(const BoardPoses& a, const BoardPoses& b, const FrameRate& rate) {
  std::vector<Sighting> all;
  for (const auto& [key, b_from_board] : b) {
    const auto frame = rate.At(key.first);
    const auto found = frame ? a.find({*frame, key.second}) : a.end();
    if (found != a.end()) all.push_back({found->second, b_from_board});
  }
  if (all.size() <= kMostShared) return all;
  std::vector<Sighting> thin;
  for (size_t i = 0; i < kMostShared; ++i) thin.push_back(all[i * all.size() / kMostShared]);
  return thin;
}

/// What nine of ten sightings keep: the distance of the board in a from where b and the most central relative pose put it, over
/// its distance. Infinite for few.
double RateDisagreement(const std::vector<Sighting>& shared) {
  constexpr double kMost = 0.9;
  constexpr size_t kCandidates = 12;
  double least = std::numeric_limits<double>::infinity();
  if (shared.size() < kLeastShared) return least;
  std::vector<double> distances(shared.size());
  for (size_t c = 0; c < kCandidates; ++c) {
    const Sighting& central = shared[c * shared.size() / kCandidates];
    const Rigid3 a_from_b = central.in_a * geometry::Inverse(central.in_b);
    for (size_t i = 0; i < shared.size(); ++i) {
      const Eigen::Vector3d& at = shared[i].in_a.translation;
      distances[i] = (a_from_b * shared[i].in_b.translation - at).norm() / at.norm();
    }
    least = std::min(least, UpperQuantile(distances, kMost));
  }
  return least;
}

struct Best {
  FrameRate rate;
  double disagreement = std::numeric_limits<double>::infinity();
};

Best BestOffset(const BoardPoses& a, const BoardPoses& b, FrameRate rate, std::vector<double>* all) {
  Best best;
  for (rate.offset = -kMostOffset; rate.offset <= kMostOffset; ++rate.offset) {
    const double disagreement = RateDisagreement(SharedSightings(a, b, rate));
    if (std::isfinite(disagreement)) all->push_back(disagreement);
    if (disagreement < best.disagreement) best = {rate, disagreement};
  }
  return best;
}

}  // namespace

std::optional<int64_t> FrameRate::At(int64_t frame) const {
  const int64_t scaled = frame * numerator;
  if (scaled % denominator != 0) return std::nullopt;
  return scaled / denominator + offset;
}

FrameRate FrameRate::Inverse() const {
  const double back = -static_cast<double>(offset) * denominator / numerator;
  return {denominator, numerator, static_cast<int64_t>(std::llround(back))};
}

std::optional<FrameRate> FindFrameRate(const BoardPoses& a, const BoardPoses& b) {
  constexpr double kClearly = 0.5, kStill = 0.02;
  constexpr int kRatios[][2] = {{2, 1}, {1, 2}, {4, 1}, {1, 4},  {6, 5},  {5, 6}, {5, 4}, {4, 5}, {5, 3},
                                {3, 5}, {3, 1}, {1, 3}, {12, 5}, {5, 12}, {5, 2}, {2, 5}, {3, 2}, {2, 3}};
  std::vector<double> all;
  const Best equal = BestOffset(a, b, {}, &all);
  Best best;
  for (const auto& [numerator, denominator] : kRatios) {
    const Best of_ratio = BestOffset(a, b, {numerator, denominator, 0}, &all);
    if (of_ratio.disagreement < best.disagreement) best = of_ratio;
  }
  const double unrelated = UpperMedian(std::move(all));
  const bool clear = best.disagreement < kClearly * equal.disagreement && best.disagreement < kClearly * unrelated;
  return clear && unrelated > kStill ? std::optional(best.rate) : std::nullopt;
}

}  // namespace mvstudio::calib
