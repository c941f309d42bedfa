#pragma once

#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/bundle/bundle.h"
#include "calib/bundle/view.h"

namespace mvstudio::calib {

struct MrcalOptions {
  std::vector<Board> boards;  ///< indexed by `View::board`; the one in use must be a full grid of corners
  BundleOptions bundle;       ///< gauge, refine_*, reject_outliers; mrcal has no counterpart of the others
  bool regularize = false;    ///< mrcal's regularization towards the image centre and zero distortion; always on for splined
                              ///< lenses
};

template <class Visitor>
void VisitFields(Visitor&& visit, MrcalOptions& o) {
  visit("mrcal-regularize", o.regularize, "pull lenses towards the image centre and no distortion, as mrcal's programs do");
}

/// Why mrcal cannot solve this problem, one line; empty when it can. mrcal supports pinhole, brown4, brown5, rational8,
/// thinprism12 and splined, one model for all cameras, and one board that is a full grid. It supports neither time offsets
/// nor poses fixed individually.
std::string WhyNotMrcal(const std::vector<View>& views, const RigState& state, const MrcalOptions& options);

/// Solves the problem of SolveBundle with libmrcal (D. Kogan, mrcal.secretsauce.net), as an independent check. Corners
/// that mrcal's own criterion rejects get weight 0. `num_iterations` is 0 because mrcal does not report it. Convergence is
/// tested here by the gain of one more Gauss-Newton step; kNotConverged if it is large. Calls are serialized, and
/// everything written to standard error meanwhile is lost. Throws UsageError when WhyNotMrcal has a reason.
BundleReport SolveWithMrcal(std::vector<View>* views, RigState* state, const MrcalOptions& options);

}  // namespace mvstudio::calib
