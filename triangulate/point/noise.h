#pragma once

#include <vector>

#include "triangulate/point/point.h"

namespace mvstudio::triangulate {

/// Median of the chi-squared distribution, to 2e-4 (Choi, "On the medians of gamma distributions", 1994).
double ChiSquaredMedian(int degrees_of_freedom);

/// Standard deviation of a pixel coordinate estimated from how well many points fit, where the observations' sigmas are taken
/// as relative: median over points of chi^2 / median(chi^2 with 2n - 3 degrees of freedom), so that neither the points' own
/// freedom nor a minority of bad points biases it. Repeated until the views selected under the estimate no longer change it. A
/// camera without which the estimate falls to less than half does not take part, so that one bad calibration does not pass as
/// noise of all (5 cameras or more). Uses at most `max_points` points, evenly spread. Returns the factor for the sigmas, or
/// `fallback` when fewer than 5 points can be used.
double EstimateNoiseScale(const PreparedRig& rig, const std::vector<std::vector<Observation>>& points,
                          const PointOptions& options, double start_scale, double fallback, int num_threads,
                          int max_points = 600);

}  // namespace mvstudio::triangulate
