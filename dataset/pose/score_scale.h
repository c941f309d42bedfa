#pragma once

#include <cstdint>

#include "dataset/pose/pose2d.h"

/// What the scores of 2D joints count: programs write shares of 1, percent, bytes or what their networks give.
namespace mvstudio::dataset {

enum class ScoreScale {
  kOne,      ///< shares of 1, a little more where a detector's peaks are
  kFlags,    ///< COCO's visibility: 1 hidden, 2 seen; both are seen here
  kPercent,  ///< 0 to 100
  kBytes,    ///< 0 to 255, whole numbers
  kPeaks,    ///< heights without a limit, to about 20
  kLogits,   ///< below 0 and above: no shares before a sigmoid
  kUnknown   ///< beyond 100, and no bytes
};

/// All scores of one source. Those of 0, and -1, which some write for it, are of nothing seen and do not count.
struct ScoreCounts {
  int64_t num = 0, num_above = 0, num_negative = 0;  ///< above: clearly above 1; negative: below -0.05
  double least = 0, most = 0;
  bool flags = true, whole = true;  ///< all are 1 or 2; all are whole numbers

  void Add(const Pose2dTrack& track);
  /// By what at least five and a twentieth of the scores say: single odd ones decide nothing.
  ScoreScale Scale() const;
};

/// Of a point in a file without scores: 1, and 0 at (0, 0) and (-1, -1), which programs write where they saw nothing.
inline double ScoreOfUnscored(double x, double y) { return x == y && (x == 0 || x == -1) ? 0 : 1; }

/// Divides by the scale's 1; what is beyond becomes 1. Shares of 1, logits and unknown ones stay.
void ScoresToShares(ScoreScale scale, Pose2dTrack* track);

}  // namespace mvstudio::dataset
