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

/// As WeightedLinear, by the normal equations where the rays allow it: an initial value needs little precision.
LinearPoint QuickStart(const std::vector<View>& views);

/// Largest WhitenedResidual.
double WorstResidual(const std::vector<View>& views, const Eigen::Vector3d& x_in_local);

/// Initial value, refinement (or the closed form of `options.method`) and checks on exactly these views.
Fit FitViews(const std::vector<View>& views, const PointOptions& options);

/// The fit to all views where they agree, else to the largest consistent set of views. kOutlier, or the status of all
/// views together, when there is none.
///
/// Views whose rays miss each other by more than their noise allows cannot be in one set. Up to 6 views: all sets without
/// such pairs, largest first. More views: the points of all pairs (or of `max_hypotheses` random ones) are ranked by the
/// truncated sum of squares over all views (MSAC: Torr and Zisserman, "MLESAC", CVIU 2000), to first order on the rays.
/// The best are refitted to their own views until these no longer change (Lebeda et al., BMVC 2012).
Fit FitConsistent(const std::vector<View>& views, const PointOptions& options);

/// The part of TriangulatePoint after its views are made. `num_observations` is the number of observations given.
/// `rejected` is the reason for the first observation without a ray; kOk when all missing ones are copies.
Point TriangulateViews(const PreparedRig& rig, const std::vector<View>& views, size_t num_observations, Status rejected,
                       const PointOptions& options);

}  // namespace mvstudio::triangulate
