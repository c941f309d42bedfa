#pragma once

#include <string>
#include <vector>

#include "triangulate/budget/budget.h"

/// The error budget of a take without truth, from the sigmas that its stages state.
namespace mvstudio::triangulate {

/// A stage with one more error of the size that it states: the square of the held-out error grows by as much as the stage's
/// present error contributes, where the stated size is true and the errors are independent.
struct StatedShare {
  BudgetStage stage = BudgetStage::kCalibration;
  bool stated = false;         ///< false: it states nothing, and its error is in the rest
  double share_px2 = 0;        ///< growth of the mean square of the held-out distance
  double share_error_px2 = 0;  ///< standard error over the seeds
  double moved_mm = 0;         ///< root mean square of how far the joints move
};

/// The held-out error of one camera that is the same in all time steps.
struct StatedCamera {
  std::string name;
  int num = 0;
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();  ///< median of observed minus projected
  double share_px2 = 0;                                ///< its part of the mean square over all cameras
};

struct StatedBudget {
  int num = 0;                        ///< held-out samples
  double mean_px2 = 0;                ///< mean square of their distance
  double sigma_px = 0;                ///< of a 2D joint, given or estimated
  std::vector<StatedShare> stages;    ///< calibration, synchronisation, 2D joints
  double rest_px2 = 0;                ///< what no sigma states; negative where they state more than there is
  double shifts_px2 = 0;              ///< of the mean square: constant shifts of the cameras' images
  double gross_px2 = 0;               ///< of the mean square: samples beyond 4 of their own sigmas from their camera's shift
  std::vector<StatedCamera> cameras;  ///< in the rig's order
};

/// `seeds`: draws of each stage's error. Errors as TriangulateTake; num = 0 where no camera can be held out.
StatedBudget MeasureStatedBudget(const BudgetTake& take, int seeds, const RunContext& run = {});

}  // namespace mvstudio::triangulate
