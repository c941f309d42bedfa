#include "triangulate/sync/rates.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "triangulate/sync/pair_curves.h"

namespace mvstudio::triangulate::internal {
namespace {

/// Ratios of usual frame rates: 24, 25, 30, 48, 50, 60, 75, 90, 100, 120, 150, 200, 240 Hz and NTSC's by 1000/1001.
std::vector<double> RateCandidates() {
  std::vector<double> rates = {1};
  for (const double rate : {1001.0 / 1000, 25.0 / 24, 6.0 / 5, 5.0 / 4, 4.0 / 3, 3.0 / 2, 8.0 / 5, 5.0 / 3, 2.0, 12.0 / 5,
                            5.0 / 2, 3.0, 10.0 / 3, 4.0, 5.0, 6.0, 8.0}) {
    rates.push_back(rate), rates.push_back(1 / rate);
  }
  return rates;
}

/// The frames of two cameras alone, the second's as often as the first's.
std::vector<DetectedFrame> TwoOf(const std::vector<DetectedFrame>& frames, size_t a, size_t b, double rate_of_b) {
  std::vector<Clock> clocks(frames.front().people.size(), {std::nan(""), 1});
  clocks[a] = {}, clocks[b] = {0, rate_of_b};
  return ApplyClocks(frames, clocks);
}

/// How clearly some offset fits two cameras at each candidate rate.
std::vector<double> StrengthsOf(const PreparedRig& rig, const std::vector<DetectedFrame>& frames, size_t a, size_t b,
                                const std::vector<double>& rates, const SyncOptions& options, const RunContext& run) {
  constexpr int64_t kMaxEvaluations = 35'000'000;  // of each rate; three people fit into 500 frames whole
  std::vector<double> strengths(rates.size(), 0);
  RunContext alone = run;
  alone.num_threads = 1, alone.progress = nullptr;
  ParallelFor(static_cast<int64_t>(rates.size()), run.num_threads, [&](int64_t i) {
    const auto curves =
        ComputePairCurves(rig, TwoOf(frames, a, b, rates[static_cast<size_t>(i)]), options, alone, kMaxEvaluations);
    for (const PairCurve& curve : curves) strengths[static_cast<size_t>(i)] = curve.Strength();
  });
  return strengths;
}

/// The first frames with people in two cameras: clocks of other rates start together and part.
std::vector<DetectedFrame> Beginning(const std::vector<DetectedFrame>& frames, size_t max_frames) {
  const auto begin = std::find_if(frames.begin(), frames.end(), [](const DetectedFrame& frame) {
    return std::count_if(frame.people.begin(), frame.people.end(), [](const auto& people) { return !people.empty(); }) > 1;
  });
  const auto left = static_cast<size_t>(frames.end() - begin);
  return {begin, begin + static_cast<std::ptrdiff_t>(std::min(left, max_frames))};
}

}  // namespace

std::vector<double> FindRates(const PreparedRig& rig, const std::vector<DetectedFrame>& frames, const SyncOptions& options,
                              const RunContext& run) {
  constexpr size_t kMaxFrames = 500;
  constexpr double kClearer = 1.3;
  const std::vector<DetectedFrame> part = Beginning(frames, kMaxFrames);
  std::vector<size_t> seen(rig.cameras.size(), 0);
  for (const DetectedFrame& frame : part) {
    for (size_t c = 0; c < seen.size(); ++c) seen[c] += !frame.people[c].empty();
  }
  const size_t first = static_cast<size_t>(std::max_element(seen.begin(), seen.end()) - seen.begin());
  const std::vector<double> candidates = RateCandidates();
  std::vector<double> rates(rig.cameras.size(), 1);
  for (size_t c = 0; c < rates.size(); ++c) {
    if (c == first || seen[c] == 0) continue;
    const std::vector<double> strengths = StrengthsOf(rig, part, first, c, candidates, options, run);
    const auto best = std::max_element(strengths.begin(), strengths.end()) - strengths.begin();
    if (strengths[static_cast<size_t>(best)] > kClearer * strengths[0]) rates[c] = candidates[static_cast<size_t>(best)];
  }
  return rates;
}

}  // namespace mvstudio::triangulate::internal
