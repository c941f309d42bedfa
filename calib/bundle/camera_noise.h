#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/bundle/view.h"

/// The noise of each camera's corners, estimated from the residuals of all of them (variance components; Helmert's method as in
/// Koch, "Parameter estimation and hypothesis testing in linear models", 1999, section 3.6). For bundle.cc.
namespace mvstudio::calib {

/// Per view: the weights of its corners before anything was rejected, relative to each other.
using Priors = std::vector<Eigen::VectorXd>;

struct CameraNoise {
  std::vector<double> limit_px;  ///< per camera: standard deviation per coordinate that decides what is an outlier
  std::vector<double> weight;    ///< per camera: to multiply weights by, 1 in the mean over the corners that count
};

/// Distances of all corners from their projections, px.
std::vector<Eigen::VectorXd> CornerDistances(const std::vector<View>& views, const RigState& state);

/// The same in units in which a corner of weight 1 has the standard deviation of its camera: times the root of its prior weight.
std::vector<Eigen::VectorXd> Standardized(const std::vector<View>& views, const RigState& state, const Priors& prior);

/// From the medians of the standardised distances.
CameraNoise RobustNoise(const std::vector<Eigen::VectorXd>& distances, const std::vector<View>& views, const RigState& state,
                        bool each_camera);

/// From the corners that are kept, since tails heavier than Gaussian are often a lens that does not reach the edges yet; at least
/// the robust one and at most a little more.
CameraNoise KeptNoise(const std::vector<Eigen::VectorXd>& distances, const std::vector<View>& views, const RigState& state,
                      bool each_camera);

/// Standard deviation per coordinate of a corner that was given weight 1, per camera, at a solution with the views' weights;
/// `sigma_px` is that of a corner whose weight is 1 now. NaN for cameras without corners.
std::vector<double> CameraSigmas(const std::vector<View>& views, const Priors& prior, double sigma_px, int num_cameras);

}  // namespace mvstudio::calib
