#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/bundle/view.h"

/// Noise of each camera's corners, estimated from all residuals. Variance components by Helmert's method as in Koch,
/// "Parameter estimation and hypothesis testing in linear models", 1999, section 3.6. For bundle.cc and
/// model_selection.cc.
namespace mvstudio::calib {

/// Per view: the initial weights of its corners, before any rejection, relative to each other.
using Priors = std::vector<Eigen::VectorXd>;

struct CameraNoise {
  std::vector<double> limit_px;  ///< per camera: standard deviation per coordinate that sets the outlier limit
  std::vector<double> weight;    ///< per camera: factor for the weights, with mean 1 over the weighted corners
};

/// Distances of all corners from their projections, px.
std::vector<Eigen::VectorXd> CornerDistances(const std::vector<View>& views, const RigState& state);

/// The distances in units in which a corner of weight 1 has its camera's standard deviation: multiplied by the root of the
/// initial weight.
std::vector<Eigen::VectorXd> Standardized(const std::vector<View>& views, const RigState& state, const Priors& prior);

/// From the medians of the standardised distances.
CameraNoise RobustNoise(const std::vector<Eigen::VectorXd>& distances, const std::vector<View>& views, const RigState& state,
                        bool each_camera);

/// From the corners that are kept, because heavy tails are often a lens that is not yet fitted towards the image's edges.
/// At least the robust estimate and at most slightly more.
CameraNoise KeptNoise(const std::vector<Eigen::VectorXd>& distances, const std::vector<View>& views, const RigState& state,
                      bool each_camera);

/// Standard deviation per coordinate of a corner with initial weight 1, per camera, at a solution with the views' weights.
/// `sigma_px` is that of a corner whose weight is 1 now. NaN for cameras without corners.
std::vector<double> CameraSigmas(const std::vector<View>& views, const Priors& prior, double sigma_px, int num_cameras);

}  // namespace mvstudio::calib
