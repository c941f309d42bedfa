#pragma once

#include <vector>

#include "triangulate/point.h"
#include "triangulate/refine.h"

namespace mvstudio::triangulate {

/// A fit to some of the views of a point. `status` is kOk only when the fit passed every geometric check.
struct Fit {
  Status status = Status::kOutlier;
  Refinement at;
  std::vector<View> views;
  double worst_sigmas = 0;  ///< largest |r| / sigma among `views`
};

/// Linear start, refinement and checks on exactly these views.
Fit FitViews(const std::vector<View>& views, const PointOptions& options);

/// The largest consistent set among `views`; `all` is the fit to all of them. Status kOutlier when there is none.
Fit SelectConsistent(const std::vector<View>& views, const Fit& all, const PointOptions& options);

}  // namespace mvstudio::triangulate
