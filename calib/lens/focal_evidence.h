#pragma once

#include <optional>

#include "calib/lens/intrinsics.h"

namespace mvstudio::calib {

/// How much the boards say about the focal length of a camera: the smallest rise of the sum of squares, in units of the
/// variance (a chi-square with one degree of freedom or so), when the focal lengths are halved or doubled, the distortion
/// rescaled such that boards parallel to the image look the same, and the boards' poses fitted again. Hundreds of thousands
/// for ordinary footage; a few dozen at most when all boards are parallel to the image, where noise makes a covariance look
/// finite although nothing is known. Nothing for wide models, which have no such scaling, and for failed solutions.
std::optional<double> FocalEvidence(const MonoSolution& solution);

/// Below it, the focal length counts as undetermined.
inline constexpr double kMinFocalEvidence = 100;

}  // namespace mvstudio::calib
