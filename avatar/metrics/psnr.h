#pragma once

#include <cstdint>
#include <vector>

#include "avatar/metrics/ssim.h"

namespace mvstudio::metrics {

/// -10 log10(mean squared error / range^2) over all channels, dB; infinity for equal images. With a box or a mask, over
/// its pixels only.
Score PsnrDb(const PlanarImage& a, const PlanarImage& b);
Score PsnrDb(const Image& a, const Image& b);
Score PsnrDb(const PlanarImage& a, const PlanarImage& b, const Box& box);
Score PsnrDb(const PlanarImage& a, const PlanarImage& b, const Mask& mask);

/// Mean of the decibels (not the decibels of the mean error) over the images with a finite value.
struct PsnrSummary {
  double mean_db = 0;        ///< infinity when every image is equal to its reference; NaN for none
  int64_t num_infinite = 0;  ///< images equal to their reference: not in the mean
};
PsnrSummary MeanPsnr(const std::vector<double>& psnr_db);

}  // namespace mvstudio::metrics
