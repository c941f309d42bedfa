#pragma once

#include <vector>

#include "triangulate/budget/budget.h"

/// Errors of a take against its truth in units of the sigmas that its stages state.
namespace mvstudio::triangulate {

/// Squared, of the cameras' offsets relative to the reference (the camera whose sigma is 0). Empty without one.
std::vector<double> WhitenedOffsets(const BudgetTake& take, const BudgetTruth& truth);

/// Squared Mahalanobis distances.
struct WhitenedJoints {
  std::vector<double> detected;     ///< each coordinate of each 2D joint, in the take's sigma
  std::vector<double> without_rig;  ///< 3D joints by the covariance from the detections alone
  std::vector<double> with_rig;     ///< and from the calibration's as well; empty where the rig states none
};

/// The rig's world is taken for the truth's where the two are within 5 cm and 3 degrees. Else the rig is moved onto the true
/// one: by a fit of all cameras, or, for `with_rig`, by the first camera alone, because a covariance is relative to something.
WhitenedJoints WhitenJoints(BudgetTake take, const BudgetTruth& truth, const RunContext& run = {});

}  // namespace mvstudio::triangulate
