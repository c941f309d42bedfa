#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <vector>

/// Scores between pictures and between sets of pictures, all in float64. Every function throws ContractViolation on NaN,
/// infinity, sizes that do not fit, and on fewer pixels or samples than its definition needs. docs/metrics.md gives the
/// conventions.
namespace mvstudio::avatar {

enum class SsimChannels {
  kRgb,   ///< SSIM of each channel, then their mean
  kLuma,  ///< SSIM of Y = 0.299 R + 0.587 G + 0.114 B (three channels) or of the only channel
};

inline constexpr int kSsimWindow = 11;

/// Structural similarity after Wang et al., "Image quality assessment: from error visibility to structural similarity", TIP
/// 2004: Gaussian window 11x11 with sigma 1.5, K1 = 0.01, K2 = 0.03, L = 1, population covariance (two passes over each
/// window), mean over the positions where the window lies inside the picture. a, b: (N, C, H, W) in [0, 1], H and W at
/// least 11. Returns (N) float64 in [-1, 1].
at::Tensor Ssim(const at::Tensor& a, const at::Tensor& b, SsimChannels channels = SsimChannels::kRgb);

/// The same before averaging over positions: (N, H - 10, W - 10) float64; element (y, x) belongs to the pixel (y + 5, x + 5).
at::Tensor SsimMap(const at::Tensor& a, const at::Tensor& b, SsimChannels channels = SsimChannels::kRgb);

/// -10 log10(mean squared error) of each picture, peak 1. a, b: (N, C, H, W). `mask`, when defined, is (N, H, W), nonzero where
/// pixels count. Returns (N) float64 dB; +infinity for equal pictures.
at::Tensor PsnrDb(const at::Tensor& a, const at::Tensor& b, const at::Tensor& mask = {});

/// Mean of the decibels (not the decibels of the mean error) over the pictures that have a finite value.
struct PsnrSummary {
  double mean_db = 0;        ///< infinity when every picture is equal to its reference
  int64_t num_infinite = 0;  ///< pictures equal to their reference: left out of the mean and counted here
};
PsnrSummary MeanPsnr(const std::vector<double>& psnr_db);

/// Intersection over union of each pair of masks after thresholding at 0.5; 1 when both are empty. (N, H, W) -> (N) float64.
at::Tensor MaskIou(const at::Tensor& a, const at::Tensor& b);

enum class FrechetForm {
  kAuto,     ///< kNuclear up to d samples, kQr above
  kNuclear,  ///< || X~ Y~^T ||_* of the centred samples, n1 x n2: exact also for singular covariances
  kQr,       ///< the same after X~ = Q R: || R1 R2^T ||_*, d x d
  kEigen,    ///< sum of sqrt of the eigenvalues of S1^(1/2) S2 S1^(1/2), clamped at 0: for comparison; loses half of the digits
};

/// Fréchet distance (squared, as is usual) between the Gaussians fitted to two sets of features, covariances with n - 1:
/// |m1 - m2|^2 + tr S1 + tr S2 - 2 tr (S1 S2)^(1/2). x: (n1, d), y: (n2, d), at least 2 samples each.
double FrechetDistance(const at::Tensor& x, const at::Tensor& y, FrechetForm form = FrechetForm::kAuto);

/// What the distance is between two halves of one set, i.e. by sampling alone: mean over `repeats` seeded random halvings of
/// (n, d), n at least 4. Both halves have n / 2 samples, so compare it with distances of sets of that size.
double FrechetSplitHalfFloor(const at::Tensor& x, uint64_t seed = 1, int repeats = 10);

/// Kernel distance: unbiased squared MMD with k(x, y) = (x.y / d + 1)^3. Binkowski et al., "Demystifying MMD GANs", ICLR 2018.
struct KernelDistance {
  double value = 0;           ///< may be negative: the estimator is unbiased
  double standard_error = 0;  ///< delete-one jackknife over both sets
};
/// x: (n1, d), y: (n2, d), at least 3 samples each.
KernelDistance KernelInceptionDistance(const at::Tensor& x, const at::Tensor& y);

}  // namespace mvstudio::avatar
