#pragma once

#include <ATen/core/Tensor.h>

#include <memory>
#include <vector>

#include "avatar/body/dynamic/dynamic_fit.h"
#include "avatar/body/offset_net/offset_net.h"
#include "avatar/body/soft/soft_silhouette.h"
#include "core/random.h"

/// The network of avatar/body/offset_net trained on a take's silhouettes.
namespace mvstudio::avatar {

struct NetworkTrainingOptions {
  body::OffsetNetSizes net;
  int steps = 500;
  int views_per_step = 2;
  double learning_rate = 2e-3;  ///< of Adam; rises over the first 20 steps, falls to 0 over the second half
  uint64_t seed = 1;
  body::SoftCoverOptions soft;
  /// Weights of the mean squared difference of the silhouettes over the mask's share of the image, of the offsets' squared
  /// Laplacian (m^2), of edges' squared strain and of the offsets' size (m).
  double silhouette = 20, laplacian = 12800, strain = 0.1, size = 1;
};

/// Trainings on one take share the atlas and the neighbours of its body. The take must outlive this.
class NetworkTraining {
 public:
  NetworkTraining(const body::TakeOutlines& take, const NetworkTrainingOptions& options, const RunContext& run);
  ~NetworkTraining();

  /// The network trained on the time steps of `indices`. Throws CancelledError.
  std::shared_ptr<const body::OffsetNet> Train(const std::vector<int>& indices) const;

 private:
  struct Surface;
  at::Tensor Loss(const at::Tensor& offsets, const body::PosedStep& step, Rng* rng) const;

  const body::TakeOutlines& take_;
  NetworkTrainingOptions options_;
  RunContext run_;
  std::shared_ptr<const Surface> surface_;
};

body::OffsetTrainer NetworkTrainer(const body::TakeOutlines& take, const NetworkTrainingOptions& options,
                                   const RunContext& run);

}  // namespace mvstudio::avatar
