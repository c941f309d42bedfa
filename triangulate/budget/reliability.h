#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/random.h"
#include "geometry/rig/rig.h"

/// Whether stated standard deviations are true: errors in units of them, against what a normal error would be.
namespace mvstudio::triangulate {

/// How often errors stayed within the regions that were stated to hold them with a given probability.
struct Reliability {
  int num = 0;                   ///< errors
  double error = 0;              ///< expected calibration error: mean of |observed - stated| over the levels; NaN: no errors
  double chance = 0;             ///< the same, as independent errors with true sigmas give it on average
  double sigma_factor = 0;       ///< by which the sigmas should grow (above 1) or shrink, from the median error
  std::vector<double> stated;    ///< probabilities, 0.05 ... 0.95
  std::vector<double> observed;  ///< part of the errors within each
};

/// `squared`: squared Mahalanobis distances of errors with `degrees_of_freedom` coordinates, 1 or 3. Values that are not
/// finite are left out.
Reliability MeasureReliability(const std::vector<double>& squared, int degrees_of_freedom);

/// Probability that a chi-squared variable with 1 or 3 degrees of freedom is at most `squared`, in closed form.
double ChiSquaredProbability(double squared, int degrees_of_freedom);

/// Errors of all cameras' poses relative to the first one, which no choice of the world changes, in units of the covariance
/// that `rig` states: independent standard normal numbers where it is true, 6 a camera. Empty where a camera states none, or
/// the covariance is singular. Both rigs have the same cameras in the same order.
std::vector<double> WhitenedPoses(const geometry::Rig& rig, const geometry::Rig& truth);

/// The rig in the frame of its first camera, with covariances relative to that camera: the errors of a rig that is put onto
/// another one at their first cameras. Exact for small errors, whatever fixed the rig's own world.
geometry::Rig RelativeToFirst(const geometry::Rig& rig);

/// The rig with an error drawn from the covariance that it states; parts without one stay as they are.
geometry::Rig DrawRig(const geometry::Rig& rig, Rng* rng);

}  // namespace mvstudio::triangulate
