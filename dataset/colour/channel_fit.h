// Private: a step of MatchColours.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/status.h"

namespace mvstudio::dataset::internal {

/// One channel of one camera at one point, in the match's space.
struct ChannelView {
  int camera = 0;
  double value = 0;
};
struct ChannelPoint {
  std::vector<ChannelView> views;
  double weight = 1;  ///< inverse variance of a grey level at this brightness
};

/// Fits value = response * (true value) + black for each camera, from points with unknown true values: robust (Huber)
/// maximum likelihood for equal noise in all views. Gauge: geometric mean of the responses 1, mean of the blacks 0.
struct ChannelFit {
  Status status = Status::kOk;  ///< kDegenerate: a response is uncertain by more than 5 %; kNotConverged
  Eigen::VectorXd response, black;
  double sigma = 0;  ///< of a view, weighted units
  double worst_response_sigma = 0;
};
ChannelFit FitChannel(const std::vector<ChannelPoint>& points, int num_cameras, bool with_black);

}  // namespace mvstudio::dataset::internal
