#pragma once

#include <optional>
#include <string_view>

namespace mvstudio {

/// Why a geometric computation did or did not give a value. A value is valid only with `kOk`.
enum class Status {
  kOk,
  kTooFewViews,         ///< fewer observations than unknowns
  kLowParallax,         ///< rays too parallel for the noise: depth is not determined
  kDegenerate,          ///< rank-deficient configuration
  kBehindCamera,        ///< the point has no positive depth in a camera that observes it
  kFarPoint,            ///< farther than the caller's limit
  kOutlier,             ///< disagrees with the other observations
  kNonFiniteInput,      ///< the input contains NaN or infinity
  kOutsideValidRadius,  ///< beyond the radius where the lens model can be inverted
  kNotConverged,        ///< the iteration ended without reaching its tolerance
  kUndefined,           ///< a residual has no value at the start of the iteration
};

/// "Ok", "TooFewViews", … as written in points.csv and in JSON.
std::string_view ToString(Status status);
std::optional<Status> StatusFromString(std::string_view text);

}  // namespace mvstudio
