#pragma once

#include <vector>

#include "triangulate/point/linear.h"
#include "triangulate/point/point.h"
#include "triangulate/point/refine.h"

namespace mvstudio::triangulate {

/// A fit to some of the views of a point. `status` is kOk only when the fit passed every geometric check.
struct Fit {
  Status status = Status::kOutlier;
  Refinement at;
  std::vector<View> views;
};

/// As WeightedLinear, by the normal equations where the rays allow it: a start needs few digits.
LinearPoint QuickStart(const std::vector<View>& views);

/// Largest WhitenedResidual.
double WorstResidual(const std::vector<View>& views, const Eigen::Vector3d& x_in_local);

/// Start, refinement (or the closed form of `options.method`) and checks on exactly these views.
Fit FitViews(const std::vector<View>& views, const PointOptions& options);

/// The fit to all views where they agree, else to the largest consistent set among them; kOutlier, or the reason that all views
/// together give, when there is none.
///
/// Views whose rays pass each other by more than their noise allows cannot be in one set. Up to 6 views: all sets without such
/// pairs, largest first. More: the points of all pairs (or of `max_hypotheses` random ones) are ranked by the truncated sum of
/// squares over all views (MSAC: Torr and Zisserman, "MLESAC", CVIU 2000), to first order on the rays; the best are refitted to
/// their own views until these no longer change (Lebeda et al., BMVC 2012).
Fit FitConsistent(const std::vector<View>& views, const PointOptions& options);

/// TriangulatePoint from its views on. `num_observations` were offered; `rejected` is why the first of those without a ray has
/// none: kOk when all that are missing are copies.
Point TriangulateViews(const PreparedRig& rig, const std::vector<View>& views, size_t num_observations, Status rejected,
                       const PointOptions& options);

}  // namespace mvstudio::triangulate
