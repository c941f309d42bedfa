#pragma once

#include <string>
#include <vector>

#include "avatar/data/pack.h"
#include "avatar/io/evaluate/evaluate.h"

/// How the held-out pictures are divided, and the scores of the parts.
namespace mvstudio::avatar {

/// Frames of one motion.
struct MotionFrames {
  std::string name;
  int first = 0, last = 0;
};
/// From "walk=90-104,turn=105-119", or the runs of consecutive numbers (by the usual step) of `frames` when `text` is empty.
/// Throws UsageError for text that does not read so, and for a motion without a frame.
std::vector<MotionFrames> ParseMotions(const std::string& text, const std::vector<int>& frames);

/// Scores of every row of a pack; `lpips` is empty without a net, `flicker` NaN in rows without a frame before.
struct RowScores {
  std::vector<metrics::PictureScore> pictures;
  std::vector<double> lpips, flicker;
};

/// Mean of the finite values; NaN when there are none.
double FiniteMean(const std::vector<double>& values);

std::vector<GroupScore> PerCamera(const AvatarPack& pack, const RowScores& scores, uint64_t seed);
std::vector<GroupScore> PerMotion(const AvatarPack& pack, const RowScores& scores, const std::vector<MotionFrames>& motions,
                                  uint64_t seed);
/// Keys as in Evaluation::intervals.
std::map<std::string, metrics::Interval> Intervals(const AvatarPack& pack, const RowScores& scores, uint64_t seed);

/// Rows of `count` pictures of each camera (-1: all), evenly over its frames.
std::vector<int64_t> Examples(const AvatarPack& pack, int count);

}  // namespace mvstudio::avatar
