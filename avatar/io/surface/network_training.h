#pragma once

#include <memory>
#include <vector>

#include "avatar/surface/offset_net.h"
#include "body/dynamic/dynamic_fit.h"
#include "body/soft/soft_silhouette.h"

/// The network of avatar/surface trained on a take's silhouettes.
namespace mvstudio::avatar {

struct NetworkTrainingOptions {
  OffsetNetOptions net{16, 16, 16, 64, 0.1};  ///< narrower than the paper's (64 channels, 256 in the MLP)
  int steps = 400;
  int views_per_step = 2;
  double learning_rate = 1e-3;
  uint64_t seed = 1;
  body::SoftCoverOptions soft;
  /// Weights of the mean squared difference of the silhouettes over the mask's share of the image, of the offsets' squared
  /// Laplacian (m^2), of edges' squared strain and of the offsets' size (m).
  double silhouette = 20, laplacian = 12800, strain = 0.1, size = 1;
};

/// Surfaces that are trained on a take share the atlas and the neighbours of its body.
class NetworkTraining {
 public:
  NetworkTraining(const body::TakeOutlines& take, const NetworkTrainingOptions& options, const RunContext& run);
  ~NetworkTraining();

  /// What a network trained on the time steps of `indices` says of any pose.
  body::PoseOffsets Train(const std::vector<int>& indices) const;
  /// The same as offsets linear in the bones' turns, which a body's file holds; nothing where the poses hardly vary.
  std::optional<body::LinearOffsets> TrainLinear(const std::vector<int>& indices) const;

 private:
  struct Surface;
  const body::TakeOutlines& take_;
  NetworkTrainingOptions options_;
  RunContext run_;
  std::shared_ptr<const Surface> surface_;
};

body::OffsetTrainer NetworkTrainer(const NetworkTraining* training);

}  // namespace mvstudio::avatar
