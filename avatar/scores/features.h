#pragma once

#include <ATen/core/Tensor.h>

namespace mvstudio::avatar {

inline constexpr char kGaborFeatureName[] = "gabor-stats-v1";
inline constexpr int kGaborFeatureSize = 240;
inline constexpr int kGaborFeatureMinPx = 32;

/// Fixed description of an image for the Fréchet and kernel distances. Nothing is learned, so the values are the same on
/// every machine (to float32 rounding of the filters) and are NOT comparable with FID. On three opponent channels (Y, R -
/// G, (R + G) / 2 - B), 4 octaves and 6 orientations, the magnitude m of a complex Gabor filter (9x9, wavelength 4 px)
/// gives, in this order:
///   144  log(mean m + 1e-3) and log(std m + 1e-3) for each channel, octave, orientation
///    60  correlations of m between the 15 pairs of orientations, luma, each octave
///    18  correlations of m between neighbouring octaves at the same orientation, luma
///    12  correlations of orientation-summed m between the 3 pairs of channels, each octave
///     6  mean and standard deviation of each channel
/// Filter energies and their joint statistics are those of Portilla and Simoncelli, "A parametric texture model", IJCV 2000.
/// images: (N, 3, H, W) in [0, 1], at least 32x32, all of one size. Returns (N, 240) float64.
at::Tensor GaborFeatures(const at::Tensor& images);

}  // namespace mvstudio::avatar
