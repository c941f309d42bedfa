// Private: whether freed lens terms may be kept, for choice.cc.
#pragma once

#include <string>
#include <vector>

#include "calib/keypoints/fit.h"

namespace mvstudio::calib {

/// What a change of lenses does to the points, beyond a similarity.
struct LensVote {
  double bend_px = 0;         ///< median distance that the points move, as their cameras see it
  double gain_px = 0;         ///< what the change explains of the held-out residuals: sqrt(before^2 - after^2)
  int num_distances = 0;      ///< distances between points of one frame that stay nearly the same over the take
  double scatter_ratio = 1;   ///< of these distances, after over before
  bool by_distances = false;  ///< these distances speak for the change
  std::string refusal;        ///< one line; empty: nothing speaks against the change
};

/// In a small volume a lens that is wrong, a camera that turns to make up for it, and a space that is bent by it fit the same
/// pixels; held-out frames of that volume cannot tell them apart. Distances that stay decide, where there are any. Else the
/// change is refused when it bends space by more than three times what it explains. Both lists hold the same joints, and points
/// of those that both rigs fit are compared. `before_px`, `after_px`: held-out error.
LensVote VoteOnLenses(const geometry::Rig& before, const std::vector<KeypointFit>& fits_before,
                      const std::vector<KeypointFit>& fits_after, double before_px, double after_px, double cauchy_px);

/// Distances that stay nearly the same over the take under `before`: how many, and their scatter under `after` over that under
/// `before`, the median (1 where there are none). Both lists hold the same joints.
struct DistanceVote {
  int num = 0;
  double scatter_ratio = 1;
};
DistanceVote CompareDistances(const std::vector<KeypointFit>& before, const std::vector<KeypointFit>& after, double cauchy_px);

/// Median distance by which points of `after` lie elsewhere than those of `before`, beyond a similarity, as the cameras of
/// `rig` see it; of points that both fit.
double BendPx(const geometry::Rig& rig, const std::vector<KeypointFit>& before, const std::vector<KeypointFit>& after,
              double cauchy_px);

}  // namespace mvstudio::calib
