#include "dataset/pose/score_scale.h"

#include <algorithm>
#include <cmath>

namespace mvstudio::dataset {
namespace {

constexpr double kHighestPeak = 20, kClearlyAbove = 1.5, kClearlyBelow = -0.05;

template <class Keypoints, class Visit>
void ForEachScore(Keypoints* track, const Visit& visit) {
  for (auto& [frame, people] : track->frames) {
    for (auto& person : people) {
      for (auto& key : person.keypoints) visit(key.score);
    }
  }
}

}  // namespace

void ScoreCounts::Add(const Pose2dTrack& track) {
  ForEachScore(&track, [&](double score) {
    if (score == 0 || score == -1 || !std::isfinite(score)) return;
    ++num;
    num_above += score > kClearlyAbove, num_negative += score < kClearlyBelow;
    least = std::min(least, score), most = std::max(most, score);
    flags &= score == 1 || score == 2, whole &= score == std::floor(score);
  });
}

ScoreScale ScoreCounts::Scale() const {
  constexpr int64_t kOneIn = 20, kFewest = 5;
  constexpr double kRounding = 0.5;
  const auto tells = [&](int64_t count) { return count >= kFewest && kOneIn * count >= num; };
  if (tells(num_negative)) return ScoreScale::kLogits;
  if (!tells(num_above)) return ScoreScale::kOne;
  if (flags) return ScoreScale::kFlags;
  if (most <= kHighestPeak) return ScoreScale::kPeaks;
  if (most <= 100 + kRounding) return ScoreScale::kPercent;
  return whole && most <= 255 ? ScoreScale::kBytes : ScoreScale::kUnknown;
}

void ScoresToShares(ScoreScale scale, Pose2dTrack* track) {
  if (scale == ScoreScale::kOne || scale == ScoreScale::kLogits || scale == ScoreScale::kUnknown) return;
  const double one = scale == ScoreScale::kPercent ? 100 : scale == ScoreScale::kBytes ? 255 : 1;
  ForEachScore(track, [&](double& score) { score = std::min(score / one, 1.0); });
}

}  // namespace mvstudio::dataset
