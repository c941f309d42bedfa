// Private: whether freed lens terms may be kept, for choice.cc.
#pragma once

#include <string>
#include <vector>

#include "calib/keypoints/fit.h"

namespace mvstudio::calib {

/// What a change of lenses does to the points, beyond a similarity.
struct LensVote {
  double bend_px = 0;        ///< median distance that the points move, as their cameras see it
  double gain_px = 0;        ///< what the change explains of the held-out residuals: sqrt(before^2 - after^2)
  int num_distances = 0;     ///< distances between points of one frame that stay nearly the same over the take
  double scatter_ratio = 1;  ///< of these distances, after over before
  std::string refusal;       ///< one line; empty: nothing speaks against the change
};

/// In a small volume a lens that is wrong, a camera that turns to make up for it, and a space that is bent by it fit the same
/// pixels; held-out frames of that volume cannot tell them apart. Distances that stay decide, where there are any. Else the
/// change is refused when it bends space by more than three times what it explains. Both lists hold the same joints, and points
/// of those that both rigs fit are compared. `before_px`, `after_px`: held-out error.
LensVote VoteOnLenses(const geometry::Rig& before, const std::vector<KeypointFit>& fits_before,
                      const std::vector<KeypointFit>& fits_after, double before_px, double after_px, double cauchy_px);

}  // namespace mvstudio::calib
