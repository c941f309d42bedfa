// Private: how well a take determines the lenses that were adjusted to it, for choice.cc.
#pragma once

#include <string>
#include <vector>

#include "calib/keypoints/choice.h"

namespace mvstudio::calib {

/// What parts of the space ask of the lenses. Held-out frames of one small volume share what the lens model leaves over, so
/// they agree on a wrong answer; parts of the volume do not.
struct LensConflict {
  bool solved = false;  ///< false: without some part of the space the points do not determine the rig
  double bend_px = 0;   ///< standard deviation of the points' places, beyond a similarity, as their cameras see it
  std::vector<Eigen::MatrixXd> lens;  ///< per camera (P, P): covariance of its parameters; zero in what was not adjusted
};

/// Jackknife over the eight parts of the space that the medians of the points along their axes make. `fits` are those of
/// `rig`, which is adjusted with `freedom`; frames that are near one another in time do not matter.
LensConflict ConflictBySpace(const geometry::Rig& rig, const std::vector<KeypointFit>& fits, const KeypointFreedom& freedom,
                             double cauchy_px, int num_threads);

/// Why a change of lenses is not determined, one line; empty: it is. `bend_px`: what it moves the points (LensVote). Refused is
/// a change of points by less than twice its own error, and one that a calibration's stated covariance of all freed terms
/// together knows better.
std::string WhyNotDetermined(const LensConflict& conflict, double bend_px, double gain_px, const geometry::Rig& given,
                             const KeypointFreedom& freedom);

}  // namespace mvstudio::calib
