// Private: the loss and gradients of a batch, for train.cc and tests.
#pragma once

#include <vector>

#include "splats/gradients.h"
#include "splats/train/train.h"

namespace mvstudio::splats {

struct BatchResult {
  LossTerms loss;                 // mean over the batch
  Parameters<float> gradient;     // of that mean
  std::vector<float> view_space;  // (N) sums over the images that show a Gaussian, of their own losses
  std::vector<int> seen;          // (N)
  SkippedSplats skipped;          // in the last image
};

/// Images side by side on the run's threads, sums in their order.
BatchResult BatchGradient(const Cloud& cloud, const Eigen::Matrix3Xi& faces, const std::vector<const TrainView*>& batch,
                          const LossWeights& weights, bool mip, int num_threads);

}  // namespace mvstudio::splats
