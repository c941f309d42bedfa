#pragma once

#include <Eigen/Core>
#include <vector>

#include "dataset/colour/colour_match.h"

/// Shared by the .cc files of colour matching.
namespace mvstudio::dataset::internal {

/// sRGB transfer function (IEC 61966-2-1) of values 0..1; continues beyond 1 and is odd about 0.
double LinearFromSrgb(double srgb);
double SrgbFromLinear(double linear);
/// d linear / d srgb.
double LinearSlope(double srgb);

/// A stored value 0..1, converted to the space of gain and offset.
double ToSpace(double srgb, ColourSpace space);
/// sRGB value 0..1 after a camera's transform.
double Corrected(double srgb, const ColourTransform& t, int channel, ColourSpace space);

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
