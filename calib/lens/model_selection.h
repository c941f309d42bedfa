#pragma once

#include <string>
#include <vector>

#include "calib/lens/lens_pool.h"
#include "core/progress.h"

namespace mvstudio::calib {

/// One configuration, judged.
struct LensCandidate {
  LensConfig config;
  LensPool fit;
  PoolHoldout holdout;
  double relative_error = 0;   ///< RMS over all held-out views of error over the camera's smallest error, gross errors capped
  bool within_one_se = false;  ///< of the best candidate
};

struct LensChoice {
  int index = -1;                         ///< of the chosen candidate; -1 when none has a solution
  std::vector<LensCandidate> candidates;  ///< fewest numbers first
  std::string reason;
};

inline constexpr double kNegligibleGain = 0.01;  ///< of the held-out error: not worth a number …
inline constexpr double kBeyondDoubt = 3;        ///< … unless it is more than so many standard errors

struct SelectionOptions {
  int folds = 10;
  int max_views = 60;              ///< of a camera
  bool sharing = true;             ///< also try one lens for all cameras
  bool separate = true;            ///< also try a lens for each camera
  bool warp = false;               ///< boards may be bent, under every lens
  bool stretch = false;            ///< boards may be stretched, under every lens
  std::vector<LensConfig> models;  ///< to compare; empty: all that the field of view and the number of corners allow
  std::vector<LensConfig> only;    ///< exactly these, whatever the other options say (but for warp and stretch)
};

/// Of the configurations whose held-out error, over all cameras of the pool, is within one standard error (of the paired
/// differences between clusters of views) of the best, or within 1 % and three standard errors of it: the simplest that does not
/// fold inside the image, if there is one; or the richer one whose residuals on all boards are better by more than its numbers
/// cost (Schwarz's criterion), and not on a board or two alone. With boards in fewer than 6 places Schwarz's criterion alone decides
/// among the simpler lenses. All cameras of a pool get one model: the views of one camera alone are too few to see a decentring
/// that shifts its principal point, and hence its direction, by a pixel.
LensChoice ChooseLens(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle,
                      const RunContext& run);

/// Splined lenses with control grids of 8, 11 and 16 columns over the field of view that the corners fill.
std::vector<LensConfig> SplinedConfigs(const LensPool& pool);

/// Two numbers a board, judged with and without them as lenses are; `reason` says why.
struct ShapeChoice {
  bool pays = false;
  double error_without = 0, error_with = 0;  ///< relative, as in LensCandidate
  std::string reason;
};

/// Do the boards bend? Under the pool's lens. All views share their boards.
ShapeChoice ChooseWarp(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle,
                       const RunContext& run);

/// Are they stretched: sides not square to each other, or longer one way than the other? Bent or not as `options.warp` says.
ShapeChoice ChooseStretch(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle,
                          const RunContext& run);

}  // namespace mvstudio::calib
