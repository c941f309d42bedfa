#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "avatar/metrics.h"

/// Scores of a set of rendered people against the truth: which pixels count, and how pictures are averaged.
namespace mvstudio::avatar {

/// A float picture in [0, 1] as an 8-bit file would give it back: float64 multiples of 1/255.
at::Tensor EightBit(const at::Tensor& pictures);

/// SSIM (Wang 2004) of RGB and of luma, PSNR in dB (infinite for equal pictures).
struct RegionScore {
  double ssim = 0, ssim_luma = 0, psnr_db = 0;
};

/// One picture. Both pictures are on black before they are compared.
struct PictureScore {
  RegionScore
      bbox;  ///< the true mask's bounding box, grown by 5 % of its longer side on each side, at least 11 px: the primary score
  RegionScore full;    ///< the whole crop
  RegionScore masked;  ///< pixels of the true mask only (SSIM: mean of the SSIM map over them)
  double mask_iou = 0;
};

/// truth, image: (N, 3, H, W) in [0, 1], on black; true_mask (N, H, W) nonzero inside; mask (N, H, W) in [0, 1].
std::vector<PictureScore> ScorePictures(const at::Tensor& truth, const at::Tensor& true_mask, const at::Tensor& image,
                                        const at::Tensor& mask);

/// Means over pictures; PSNR is the mean of the finite decibels, equal pictures are counted.
struct MeanScore {
  int64_t n = 0;
  RegionScore bbox, full, masked;
  double mask_iou = 0;
  int64_t psnr_infinite = 0;  ///< pictures equal to the truth in their box
};
MeanScore Mean(const std::vector<PictureScore>& scores);

struct Interval {
  double low = 0, high = 0;
};
/// 95 % interval of the mean of `values` by resampling blocks of neighbouring frames (sqrt(number of frames) long), all
/// pictures of a frame together: neighbouring frames look alike and do not count as independent. `frames` as long as `values`.
Interval BlockBootstrap(const std::vector<double>& values, const std::vector<int64_t>& frames, uint64_t seed);

/// Distances between two sets of features.
struct SetDistance {
  double fd = 0;     ///< Fréchet distance
  double floor = 0;  ///< mean Fréchet distance of random halves of the truth (n / 2 pictures each)
  KernelDistance kid;
  int64_t n = 0, d = 0;
  std::string features;
};
/// Of the Gabor statistics of two sets of N pictures; nothing below 4 pictures or for pictures under 32 px.
std::optional<SetDistance> CompareSets(const at::Tensor& truth, const at::Tensor& images, uint64_t seed);

}  // namespace mvstudio::avatar
