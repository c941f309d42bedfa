// Private: the loss and gradients of a batch, for train.cc and tests.
#pragma once

#include <vector>

#include "avatar/splats/gradients.h"
#include "avatar/splats/train/train.h"

namespace mvstudio::splats {

struct BatchResult {
  LossTerms loss;                 // mean over the batch
  Parameters<float> gradient;     // of that mean
  std::vector<float> view_space;  // (N) sums over the images that show a Gaussian, of their own losses
  std::vector<int> seen;          // (N)
  SkippedSplats skipped;          // in the last image
};

/// Images side by side on the run's threads, sums in their order. `turns` holds BoneTurns of the images of a cloud with a
/// corrective of poses, on `bones`; both may be empty for others.
struct BatchBends {
  Eigen::Matrix2Xi bones;
  std::vector<Eigen::Matrix3Xf> turns;
};
BatchResult BatchGradient(const Cloud& cloud, const Eigen::Matrix3Xi& faces, const std::vector<const TrainView*>& batch,
                          const BatchBends& bends, const LossWeights& weights, bool mip, int num_threads);

}  // namespace mvstudio::splats
