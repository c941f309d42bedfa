#pragma once

#include <vector>

#include "geometry/rig/rig.h"
#include "triangulate/point/types.h"

namespace mvstudio::triangulate {

struct ExhaustiveDltOptions {
  double max_error_px = 15;  ///< mean reprojection error that ends the search
  double min_score = 0.3;    ///< observations below are left out
  int max_excluded_views = 2;
};

/// Pose2Sim's triangulation (Pagnon et al., "Pose2Sim: an end-to-end workflow for 3D markerless sports kinematics", Sensors
/// 2021), for comparison with results of that program: homogeneous DLT in pixels, rows (P0 - x P2) s and (P1 - y P2) s weighted
/// with the score s, lenses taken as pinholes; all subsets of views with 0, 1, 2, … left out until the smallest mean distance
/// is within the limit. Knows no covariance and no depth sign. The better method is TriangulatePoint.
Point TriangulateExhaustiveDlt(const geometry::Rig& rig, const std::vector<Observation>& observations,
                               const ExhaustiveDltOptions& options = {});

}  // namespace mvstudio::triangulate
