#pragma once

#include <vector>

#include "triangulate/point/point.h"

namespace mvstudio::triangulate {

/// Median of the chi-squared distribution, to 2e-4 (Choi, "On the medians of gamma distributions", 1994).
double ChiSquaredMedian(int degrees_of_freedom);

/// Standard deviation of a pixel coordinate, estimated from the residuals of many points, with the observations' sigmas as
/// relative values. Median over points of chi^2 / median(chi^2 with 2n - 3 degrees of freedom), so that neither the
/// points' degrees of freedom nor a minority of bad points biases it. Repeated until the views selected under the estimate
/// no longer change it.
///
/// A camera is excluded if the estimate falls to less than half without it, so that one bad calibration does not count as
/// noise of all (5 cameras or more). Uses at most `max_points` points, evenly spaced. Returns the factor for the sigmas,
/// or `fallback` when fewer than 5 points can be used.
double EstimateNoiseScale(const PreparedRig& rig, const std::vector<std::vector<Observation>>& points,
                          const PointOptions& options, double start_scale, double fallback, int num_threads,
                          int max_points = 600);

}  // namespace mvstudio::triangulate
