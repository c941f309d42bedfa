#pragma once

#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/bundle/bundle.h"
#include "calib/bundle/view.h"

namespace mvstudio::calib {

struct MrcalOptions {
  std::vector<Board> boards;  ///< those that `View::board` counts; the one in use must be a full grid of corners
  BundleOptions bundle;       ///< gauge, refine_*, reject_outliers; the others are ours alone
  bool regularize = false;    ///< mrcal's pull of the lens towards the centre and no distortion; always on for splined lenses
};

template <class Visitor>
void VisitFields(Visitor&& visit, MrcalOptions& o) {
  visit("mrcal-regularize", o.regularize, "pull lenses towards the image centre and no distortion, as mrcal's programs do");
}

/// What mrcal cannot do of this problem, one line; empty when it can. It knows pinhole, brown4, brown5, rational8, thinprism12
/// and splined, the same for all cameras; one board, a full grid; no time offsets, no poses fixed one by one.
std::string WhyNotMrcal(const std::vector<View>& views, const RigState& state, const MrcalOptions& options);

/// The same problem as SolveBundle, solved by libmrcal (D. Kogan, mrcal.secretsauce.net): a second opinion. Corners that
/// mrcal's own criterion rejects get the weight 0. `num_iterations` is 0, mrcal does not tell; whether it converged is judged
/// here, by what one more Gauss-Newton step would bring, and kNotConverged otherwise. Calls wait for each other, and what
/// anything writes to standard error meanwhile is lost. Throws UsageError when WhyNotMrcal has a reason.
BundleReport SolveWithMrcal(std::vector<View>* views, RigState* state, const MrcalOptions& options);

}  // namespace mvstudio::calib
