#pragma once

#include <string>
#include <vector>

#include "calib/lens/lens_pool.h"
#include "core/progress.h"

namespace mvstudio::calib {

/// A lens configuration and its held-out error.
struct LensCandidate {
  LensConfig config;
  LensPool fit;
  PoolHoldout holdout;
  double relative_error = 0;   ///< RMS over all held-out views of the error relative to the camera's smallest error; gross
                               ///< errors capped
  bool within_one_se = false;  ///< of the best candidate
};

struct LensChoice {
  int index = -1;                         ///< of the chosen candidate; -1 when none has a solution
  std::vector<LensCandidate> candidates;  ///< fewest parameters first
  std::string reason;
  std::string beyond;  ///< the lens does not pass where no board was: which simpler one comes nearest; empty: it passes
};

inline constexpr double kNegligibleGain = 0.01;  ///< of the held-out error: not worth a parameter …
inline constexpr double kBeyondDoubt = 3;        ///< … unless it exceeds this many standard errors

struct SelectionOptions {
  int folds = 10;
  int max_views = 60;              ///< maximum per camera
  bool sharing = true;             ///< also try one lens for all cameras
  bool separate = true;            ///< also try a lens for each camera
  bool warp = false;               ///< boards may be warped, under every lens
  bool stretch = false;            ///< boards may be stretched, under every lens
  double need_px = 0;              ///< of projections where no board was, see PixelLimitsOf
  std::vector<LensConfig> models;  ///< to compare; empty: all that the field of view and the number of corners allow
  std::vector<LensConfig> only;    ///< exactly these, whatever the other options say (except warp and stretch)
};

/// Chooses one lens model for all cameras of a pool.
///
/// Candidates are configurations whose held-out error, over all cameras of the pool, is within one standard error (of the
/// paired differences between clusters of views) of the best, or within 1 % and three standard errors of it. The simplest
/// candidate wins, preferably one that does not fold inside the image. A richer one wins if it lowers the residuals on all
/// boards by more than its parameters cost (Schwarz's criterion), and not only on one or two boards. With boards in fewer
/// than 6 places, Schwarz's criterion alone decides among the simpler lenses.
///
/// Where the lens so chosen folds inside the image or is uncertain beyond what the verdict accepts, the simplest lens takes its
/// place that passes and is within one standard error, or 2 %, of the best. Lenses that cannot win are not held out and are
/// no candidates (TryLenses).
///
/// All cameras of a pool get one model: the views of a single camera are too few to detect a decentring that shifts its
/// principal point, and hence its direction, by a pixel.
LensChoice ChooseLens(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle,
                      const RunContext& run);

/// Splined lenses with control grids of 8, 11 and 16 columns over the field of view that the corners fill.
std::vector<LensConfig> SplinedConfigs(const LensPool& pool);

/// Whether two parameters per board pay off, tested with and without them as for lenses; `reason` says why.
struct ShapeChoice {
  bool untried = true;  ///< too few views
  bool pays = false;
  double error_without = 0, error_with = 0;  ///< relative, as in LensCandidate
  std::string reason;
};

/// Tests whether the boards are warped, with the pool's lens. All views share their boards.
ShapeChoice ChooseWarp(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle,
                       const RunContext& run);

/// Tests whether they are stretched: sides not perpendicular, or of different scale. With or without warp, as
/// `options.warp` says.
ShapeChoice ChooseStretch(const LensPool& pool, const SelectionOptions& options, const BundleOptions& bundle,
                          const RunContext& run);

}  // namespace mvstudio::calib
