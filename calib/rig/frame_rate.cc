#include "calib/rig/frame_rate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>
#include <utility>

#include "core/format.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

constexpr int64_t kMostOffset = 60;
constexpr size_t kLeastShared = 12, kMostShared = 60;

/// The board in both cameras at one moment.
struct SharedBoard {
  Rigid3 in_a, in_b;
};

std::vector<SharedBoard> SharedBoards(const BoardPoses& a, const BoardPoses& b, const FrameRate& rate, size_t* num_shared) {
  std::vector<SharedBoard> all;
  for (const auto& [key, b_from_board] : b) {
    const auto frame = rate.At(key.first);
    const auto found = frame ? a.find({*frame, key.second}) : a.end();
    if (found != a.end()) all.push_back({found->second, b_from_board});
  }
  *num_shared = all.size();
  if (all.size() <= kMostShared) return all;
  std::vector<SharedBoard> thin;
  for (size_t i = 0; i < kMostShared; ++i) thin.push_back(all[i * all.size() / kMostShared]);
  return thin;
}

/// What nine of ten observations keep: the distance of the board in a from where b and the most central relative pose put it,
/// over its distance. Infinite for few.
double RateDisagreement(const std::vector<SharedBoard>& shared, const BoardTurns& turns) {
  constexpr double kMost = 0.9;
  constexpr size_t kCandidates = 12;
  double least = std::numeric_limits<double>::infinity();
  if (shared.size() < kLeastShared) return least;
  std::vector<double> distances(shared.size());
  const size_t num_turns = static_cast<size_t>(turns.num);
  for (size_t c = 0; c < kCandidates * num_turns; ++c) {
    const SharedBoard& central = shared[c / num_turns * shared.size() / kCandidates];
    const Rigid3 a_from_b = turns.RelativePose(central.in_a, central.in_b, static_cast<int>(c % num_turns));
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

/// Whether the frames that a rate pairs are a good part of those that it could pair: few of them agree by chance.
bool PairsEnough(size_t num_shared, size_t num_a, size_t num_b, const FrameRate& rate) {
  constexpr double kPart = 0.4;
  const double of_b = std::min(static_cast<double>(num_b), static_cast<double>(num_a) * rate.denominator / rate.numerator);
  return static_cast<double>(num_shared) * rate.denominator >= kPart * of_b;
}

Best BestOffset(const BoardPoses& a, const BoardPoses& b, FrameRate rate, const BoardTurns& turns, std::vector<double>* all) {
  Best best;
  const int64_t most = kMostOffset * rate.denominator;
  for (rate.offset = -most; rate.offset <= most; ++rate.offset) {
    size_t num_shared = 0;
    const double disagreement = RateDisagreement(SharedBoards(a, b, rate, &num_shared), turns);
    if (std::isfinite(disagreement)) all->push_back(disagreement);
    const bool counts = rate.same() || PairsEnough(num_shared, a.size(), b.size(), rate);
    if (counts && disagreement < best.disagreement) best = {rate, disagreement};
  }
  return best;
}

}  // namespace

std::optional<int64_t> FrameRate::At(int64_t frame) const {
  const int64_t scaled = frame * numerator + offset;
  return scaled % denominator == 0 ? std::optional(scaled / denominator) : std::nullopt;
}

std::optional<FrameRate> FindFrameRate(const BoardPoses& a, const BoardPoses& b, const BoardTurns& turns) {
  constexpr double kClearly = 0.5, kStill = 0.02;
  constexpr int kRatios[][2] = {{2, 1}, {1, 2}, {4, 1}, {1, 4},  {6, 5},  {5, 6}, {5, 4}, {4, 5}, {5, 3},
                                {3, 5}, {3, 1}, {1, 3}, {12, 5}, {5, 12}, {5, 2}, {2, 5}, {3, 2}, {2, 3}};
  std::vector<double> all;
  const Best equal = BestOffset(a, b, {}, turns, &all);
  Best best;
  for (const auto& [numerator, denominator] : kRatios) {
    const Best of_ratio = BestOffset(a, b, {numerator, denominator, 0}, turns, &all);
    if (of_ratio.disagreement < best.disagreement) best = of_ratio;
  }
  const double unrelated = UpperMedian(std::move(all));
  const bool clear = best.disagreement < kClearly * equal.disagreement && best.disagreement < kClearly * unrelated;
  return clear && unrelated > kStill ? std::optional(best.rate) : std::nullopt;
}

namespace {

struct RatedPair {
  int a = 0, b = 0;
  FrameRate rate;  // from frames of b to those of a

  bool Has(int camera) const { return a == camera || b == camera; }
};

/// The camera in most of the pairs; of two alike the one with fewer frames a second.
int OddCamera(const std::vector<RatedPair>& pairs, int num_cameras) {
  int odd = -1, most = 0;
  double slowest = 0;
  for (int c = 0; c < num_cameras; ++c) {
    int count = 0;
    double per_frame = 0;  // frames of the others in one of its own
    for (const RatedPair& pair : pairs) {
      if (!pair.Has(c)) continue;
      const double ratio = static_cast<double>(pair.rate.numerator) / pair.rate.denominator;
      ++count, per_frame = std::max(per_frame, pair.b == c ? ratio : 1 / ratio);
    }
    if (count > most || (count == most && count > 0 && per_frame > slowest)) odd = c, most = count, slowest = per_frame;
  }
  return odd;
}

}  // namespace

std::vector<FrameRate> FindFrameRates(const std::vector<View>& views, const std::vector<Rigid3>& cam_from_board,
                                      const std::vector<int64_t>& frames, const FrameOffsets& offsets,
                                      const BoardTurns& turns) {
  const int num_cameras = static_cast<int>(offsets.shift.size());
  std::vector<BoardPoses> poses(offsets.shift.size());
  for (size_t v = 0; v < views.size(); ++v) {
    if ((views[v].weights.array() > 0).any() && cam_from_board[v].translation.norm() > 0)
      poses[static_cast<size_t>(views[v].camera_idx)][{frames[static_cast<size_t>(views[v].frame)], views[v].board}] =
          cam_from_board[v] * turns.board_from_middle;
  }
  std::vector<RatedPair> pairs;
  for (const FramePair& pair : offsets.pairs) {
    if (pair.kind != FramePair::Kind::kInconsistent) continue;
    const auto rate = FindFrameRate(poses[static_cast<size_t>(pair.a)], poses[static_cast<size_t>(pair.b)], turns);
    if (rate) pairs.push_back({pair.a, pair.b, *rate});
  }
  std::vector<FrameRate> rates;
  while (!pairs.empty()) {
    rates.resize(offsets.shift.size());
    const int odd = OddCamera(pairs, num_cameras);
    const auto of_odd = std::find_if(pairs.begin(), pairs.end(), [&](const RatedPair& pair) { return pair.Has(odd); });
    rates[static_cast<size_t>(odd)] = of_odd->b == odd ? of_odd->rate : of_odd->rate.Inverse();
    pairs.erase(std::remove_if(pairs.begin(), pairs.end(), [&](const RatedPair& pair) { return pair.Has(odd); }), pairs.end());
  }
  return rates;
}

std::string ToString(const std::vector<FrameRate>& rates, const std::vector<std::string>& camera_names) {
  std::string text;
  for (size_t c = 0; c < rates.size(); ++c) {
    const FrameRate& rate = rates[c];
    if (rate.same()) continue;
    const std::string times = rate.numerator == 1 ? "" : std::to_string(rate.numerator) + " ";
    const std::string offset = rate.offset == 0 ? "" : Format(" %+lld", static_cast<long long>(rate.offset));
    const std::string frame =
        rate.denominator == 1 ? times + "f" + offset : "(" + times + "f" + offset + ") / " + std::to_string(rate.denominator);
    text += Format("%s%d %s of %s as long as %d of the others (its frame f is their frame %s)", text.empty() ? "" : ", ",
                   rate.denominator, rate.denominator == 1 ? "frame" : "frames",
                   (camera_names[c] + (rate.denominator == 1 ? " lasts" : " last")).c_str(), rate.numerator, frame.c_str());
  }
  return text;
}

void ApplyFrameRates(const std::vector<FrameRate>& rates, std::vector<Detection>* detections) {
  std::set<std::tuple<int, int64_t, int>> taken;
  std::vector<Detection> kept;
  for (Detection& detection : *detections) {
    const FrameRate& rate = rates[static_cast<size_t>(detection.camera_idx)];
    const auto frame = rate.At(detection.frame_idx);
    if (!frame || !taken.insert({detection.camera_idx, *frame, detection.board_idx}).second) continue;
    detection.frame_idx = *frame;
    kept.push_back(std::move(detection));
  }
  *detections = std::move(kept);
}

}  // namespace mvstudio::calib
