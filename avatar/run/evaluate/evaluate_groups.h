#pragma once

#include <string>
#include <vector>

#include "avatar/data/pack.h"
#include "avatar/run/evaluate/evaluate.h"

/// Groups of the held-out images, and their scores.
namespace mvstudio::avatar {

/// Frames of one motion.
struct MotionFrames {
  std::string name;
  int first = 0, last = 0;
};
/// Parses "walk=90-104,turn=105-119"; when `text` is empty, takes the runs of consecutive numbers (by the usual step) of
/// `frames`, which end where a frame of `cuts` (ascending) begins another clip. Throws UsageError for invalid text, and for
/// a motion without a frame.
std::vector<MotionFrames> ParseMotions(const std::string& text, const std::vector<int>& frames,
                                       const std::vector<int>& cuts = {});

/// Scores of every row of a pack; `lpips` is empty without a net, `flicker` is NaN in rows without a previous frame.
struct RowScores {
  std::vector<metrics::ImageScore> images;
  std::vector<double> lpips, flicker;
};

/// Mean of the finite values; NaN when there are none.
double FiniteMean(const std::vector<double>& values);

std::vector<GroupScore> PerCamera(const AvatarPack& pack, const RowScores& scores, uint64_t seed);
std::vector<GroupScore> PerMotion(const AvatarPack& pack, const RowScores& scores, const std::vector<MotionFrames>& motions,
                                  uint64_t seed);
/// Keys as in Evaluation::intervals.
std::map<std::string, metrics::Interval> Intervals(const AvatarPack& pack, const RowScores& scores, uint64_t seed);

/// Rows of `count` images of each camera (-1: all), evenly spaced over its frames.
std::vector<int64_t> Examples(const AvatarPack& pack, int count);

}  // namespace mvstudio::avatar
