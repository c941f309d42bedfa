#pragma once

#include "core/progress.h"
#include "geometry/skeleton/skeleton.h"
#include "stages/people/marker_export.h"
#include "triangulate/point/holdout.h"
#include "triangulate/take/take.h"

/// What filling and filtering do to cameras that had no part in the points.
namespace mvstudio::stages {

struct FilterCheck {
  int num_cameras = 0;  ///< left out in turn
  /// What the left-out cameras detected, against the points of the others: as triangulated, and filled and filtered.
  triangulate::LeftOutFigures before, after;
  triangulate::PairedDifference difference;  ///< after minus before
  /// The filtered points predict worse, in the median or in the 90 % quantile (fast joints), by more than twice the standard
  /// error and by more than 2 %: motion was smoothed away. Figures: docs/triangulation.md.
  bool Hurts() const;
};

/// At most `max_cameras` cameras, evenly spread over those with detections. `solve` triangulated the take, single points before
/// any refinement.
FilterCheck CheckFilter(const triangulate::PreparedRig& rig, const triangulate::TakeResult& take,
                        const triangulate::PointSolver& solve, const geometry::Skeleton& skeleton, const MarkerOptions& options,
                        const RunContext& run, int max_cameras = 5);

}  // namespace mvstudio::stages
