#pragma once

#include <cstdint>
#include <vector>

#include "avatar/metrics/masks.h"
#include "avatar/metrics/psnr.h"

/// Scores of rendered people against the truth: regions of pixels, and means over images.
namespace mvstudio::metrics {

/// SSIM in three conventions (Wang 2004 of RGB, the same of luma, scikit-image's default of RGB) and PSNR, dB (infinite for
/// equal images).
struct RegionScore {
  double ssim = 0, ssim_luma = 0, ssim_skimage = 0, psnr_db = 0;
};

/// For the whole image. Throws ContractViolation with the reason when there is no score (docs/metrics.md).
RegionScore ScoreWhole(const PlanarImage& truth, const PlanarImage& image);
RegionScore ScoreWhole(const Image& truth, const Image& image);

/// One image. Both images are on black before they are compared.
struct ImageScore {
  RegionScore bbox;    ///< the true mask's bounding box, enlarged by 5 % of its longer side on each side, at least 11 px: the
                       ///< primary score
  RegionScore full;    ///< the whole crop
  RegionScore masked;  ///< pixels of the true mask only (SSIM: windows around them)
  double mask_iou = 0;
  double boundary_f = 0;  ///< of the masks' outlines, tolerance BoundaryTolerancePx
};

/// truth, image: three channels; masks of their size, the true one not empty (else ContractViolation).
ImageScore ScoreImage(const PlanarImage& truth, const Mask& true_mask, const PlanarImage& image, const Mask& mask);

/// Means over images; PSNR is the mean of the finite decibels, equal images are counted.
struct MeanScore {
  int64_t n = 0;
  RegionScore bbox, full, masked;
  double mask_iou = 0, boundary_f = 0;
  int64_t psnr_infinite = 0;  ///< images equal to the truth in their box
};
MeanScore Mean(const std::vector<ImageScore>& scores);
RegionScore Mean(const std::vector<RegionScore>& scores, int64_t* psnr_infinite);

struct Interval {
  double low = 0, high = 0;
};
/// 95 % interval of the mean of `values` by a block bootstrap: blocks of neighbouring frames (sqrt(number of frames)
/// long), all images of a frame together, because neighbouring frames are not independent. `frames` is as long as
/// `values`. NaN for a single frame, which shows no spread.
Interval BlockBootstrap(const std::vector<double>& values, const std::vector<int64_t>& frames, uint64_t seed);

}  // namespace mvstudio::metrics
