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

/// Pose2Sim's triangulation (Pagnon et al., "Pose2Sim: an end-to-end workflow for 3D markerless sports kinematics",
/// Sensors 2021), for comparison with that program. Homogeneous DLT in pixels with rows (P0 - x P2) s and (P1 - y P2) s
/// weighted by the score s; lenses are taken as pinholes. Subsets with 0, 1, 2, … views left out are tried until the
/// smallest mean distance is within the limit. No covariance and no check of the depth's sign. TriangulatePoint is the
/// better method.
Point TriangulateExhaustiveDlt(const geometry::Rig& rig, const std::vector<Observation>& observations,
                               const ExhaustiveDltOptions& options = {});

}  // namespace mvstudio::triangulate
