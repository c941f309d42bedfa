// Private: the steps of RankCauses, for cause*.cc.
#pragma once

#include <vector>

#include "triangulate/take/cause.h"

namespace mvstudio::triangulate::internal {

/// Of one frame: detections that points could carry, those that points do, and the sum of min(residual, limit) over the former.
struct FrameFit {
  int offered = 0, carried = 0;
  double cost_px = 0;
  int upright = 0, mirrored = 0;  // people whose left and right are where they belong, and others
};

constexpr double kLimitSigmas = 4;  // as TakeOptions::max_residual_sigmas

/// How takes are judged: the noise allowed, and how many views make a point.
struct Judge {
  CauseOptions options;
  double sigma_px = 1;
  int min_views = 3;
  int num_threads = 1;
  BodySides sides = {};

  double limit_px() const { return kLimitSigmas * sigma_px; }
};

/// By joint, how many people of a camera's show it, largest number first. [joint][camera]
std::vector<std::vector<int>> CountSeen(const DetectedFrame& frame, double min_score, int max_persons);

/// Persons of which `min_views` cameras show this joint, at most.
int PersonsOf(const std::vector<int>& sorted_counts, int min_views);

std::vector<FrameFit> FitFrames(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const Judge& judge);

}  // namespace mvstudio::triangulate::internal
