#pragma once

#include <string>
#include <vector>

#include "calib/lens/lens_limits.h"
#include "calib/lens/model_selection.h"

/// What a lens says of the image where no board was: it may fold there, or be uncertain. The verdict judges lenses by these
/// figures, so ChooseLens does, too.
namespace mvstudio::calib {

/// A pool's lenses where no board was, the worst camera.
struct BeyondBoards {
  enum class Level { kPass, kWarn, kFail };
  Level level = Level::kPass;
  double side_px = 0;   ///< uncertainty at the image's sides; NaN: cannot be said
  double folded = 0;    ///< share of the image
  bool is_lens = true;  ///< its decentring is that of a lens (geometry::HasLensDecentring)
};
BeyondBoards JudgeBeyond(const LensPool& fit, const BundleOptions& options, double need_px);
/// "31.8 px uncertain at the image's sides", "folded in 12 % of the image".
std::string ToString(const BeyondBoards& beyond);

/// Whether `a` is to be taken instead of `b`: it passes more, or it is sound where the other is not and neither fails.
bool IsSafer(const BeyondBoards& a, const BeyondBoards& b);

/// Which lenses held-out boards do not tell from the best, or barely: to 2 % of its error, and to 10 % where the chosen one gives
/// no ray for more than a tenth of an image or has a decentring that no lens has. One flag a candidate.
std::vector<bool> NearTheBest(const std::vector<LensCandidate>& candidates, int chosen);

/// The lens to take for `chosen`: of those that held-out boards do not tell from the best (`near`, one flag a candidate), the
/// simplest that passes better where no board was, or warns as it does but is a lens and does not fold in the image. `chosen`
/// itself where none does. `note` then says which of them comes nearer than `chosen`, if one does, or why the other was taken.
/// A lens that held-out boards tell from the best is never named.
int PassingLens(const std::vector<LensCandidate>& candidates, const std::vector<bool>& near, int chosen,
                const BundleOptions& options, double need_px, std::string* note);

}  // namespace mvstudio::calib
