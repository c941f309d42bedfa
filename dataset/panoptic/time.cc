#include "dataset/panoptic/time.h"

#include <algorithm>
#include <cmath>

#include "core/statistics.h"

namespace mvstudio::dataset {
namespace {

constexpr double kColorDelayMs = 6.25;

/// The table's time of a frame; nothing outside the table and where it says that there was none.
std::optional<double> TableTime(const PanopticSyncTrack& track, int64_t position) {
  if (position < 0 || position >= static_cast<int64_t>(track.univ_time_ms.size())) return std::nullopt;
  const double time = track.univ_time_ms[static_cast<size_t>(position)];
  return time >= 0 ? std::optional(time) : std::nullopt;
}

}  // namespace

std::optional<double> PanopticClock::TimeMs(int frame) const {
  const auto found = known_ms.find(frame);
  if (found != known_ms.end()) return found->second;
  return is_line ? std::optional(origin_ms + period_ms * frame) : std::nullopt;
}

std::optional<int> PanopticClock::NearestFrame(double time_ms) const {
  std::optional<int> nearest;
  double distance = INFINITY;
  for (const auto& [frame, time] : known_ms) {
    if (std::abs(time - time_ms) < distance) distance = std::abs(time - time_ms), nearest = frame;
  }
  if (is_line) {
    const double frame = std::round((time_ms - origin_ms) / period_ms);
    if (frame < 0 || frame > 1e8) return std::nullopt;
    if (std::abs(origin_ms + period_ms * frame - time_ms) < distance) nearest = static_cast<int>(frame), distance = 0;
  }
  return distance <= (is_line ? period_ms : 20) ? nearest : std::nullopt;
}

PanopticClock FitPanopticClock(std::map<int, double> known_ms) {
  PanopticClock clock;
  clock.known_ms = std::move(known_ms);
  const auto& known = clock.known_ms;
  if (known.size() < 2) return clock;
  const double n = static_cast<double>(known.size()), f0 = known.begin()->first, t0 = known.begin()->second;
  double f = 0, t = 0, ff = 0, ft = 0;
  for (const auto& [frame, time] : known) f += frame - f0, t += time - t0;
  f /= n, t /= n;
  for (const auto& [frame, time] : known) {
    const double df = frame - f0 - f;
    ff += df * df, ft += df * (time - t0 - t);
  }
  clock.period_ms = ft / ff;
  clock.origin_ms = t0 + t - clock.period_ms * (f0 + f);
  for (const auto& [frame, time] : known)
    clock.worst_ms = std::max(clock.worst_ms, std::abs(clock.origin_ms + clock.period_ms * frame - time));
  clock.is_line = clock.period_ms > 0 && std::isfinite(clock.worst_ms) && clock.worst_ms < 0.25 * clock.period_ms;
  return clock;
}

PanopticTableMatch MatchPanopticTable(const std::map<int, double>& known_ms, const PanopticSyncTrack& track) {
  PanopticTableMatch best;
  best.residual_ms = INFINITY;
  for (const int shift : {1, 0, 2, -1, 3, -2, 4, -3}) {
    std::vector<double> differences;
    for (const auto& [frame, time] : known_ms) {
      if (const auto table = TableTime(track, int64_t{frame} + shift)) differences.push_back(std::abs(*table - time));
    }
    if (differences.empty()) continue;
    const double residual = UpperMedian(differences);
    if (residual < best.residual_ms) best = {shift, static_cast<int>(differences.size()), residual};
  }
  if (best.compared == 0) best.residual_ms = 0;
  return best;
}

void AddTable(const PanopticSyncTrack& track, const PanopticTableMatch& match, std::map<int, double>* known_ms) {
  for (int64_t position = std::max(match.shift, 0); position < static_cast<int64_t>(track.univ_time_ms.size()); ++position) {
    if (const auto time = TableTime(track, position)) known_ms->emplace(static_cast<int>(position - match.shift), *time);
  }
}

std::map<int, double> KinectColorTimesMs(const PanopticSyncTables& tables, int node) {
  std::map<int, double> times;
  const PanopticSyncTrack* track = tables.Find("kinect.color.KINECTNODE" + std::to_string(node));
  if (!track) return times;
  for (size_t i = 0; i < track->univ_time_ms.size(); ++i) {
    if (track->univ_time_ms[i] >= 0) times[static_cast<int>(i) + 1] = track->univ_time_ms[i] - kColorDelayMs;
  }
  return times;
}

}  // namespace mvstudio::dataset
