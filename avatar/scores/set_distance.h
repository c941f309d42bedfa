#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "avatar/nets/feature_net.h"

/// Distances between two sets of images by features of each image, in float64. Every function throws ContractViolation on
/// NaN, infinity, inconsistent sizes, and on fewer samples than its definition needs. docs/metrics.md gives the
/// conventions.
namespace mvstudio::avatar {

enum class FrechetForm {
  kAuto,     ///< kNuclear up to d samples, kQr above
  kNuclear,  ///< || X~ Y~^T ||_* of the centred samples, n1 x n2: exact also for singular covariances
  kQr,       ///< the same after X~ = Q R: || R1 R2^T ||_*, d x d
  kEigen,    ///< sum of sqrt of the eigenvalues of S1^(1/2) S2 S1^(1/2), clamped at 0: for comparison; loses half of the
             ///< digits
};

/// Fréchet distance (squared, as is usual) between the Gaussians fitted to two sets of features, covariances with n - 1:
/// |m1 - m2|^2 + tr S1 + tr S2 - 2 tr (S1 S2)^(1/2). x: (n1, d), y: (n2, d), at least 2 samples each.
double FrechetDistance(const at::Tensor& x, const at::Tensor& y, FrechetForm form = FrechetForm::kAuto);

/// A Gaussian by its mean, (d), and any matrix (m, d) with root^T root = covariance.
struct GaussianFit {
  at::Tensor mean, root;
};
/// Of (n, d) samples, covariance with n - 1.
GaussianFit FitGaussian(const at::Tensor& x);
/// Of a mean (d) and a symmetric covariance (d, d); eigenvalues below 0 count as 0.
GaussianFit GaussianOf(const at::Tensor& mean, const at::Tensor& covariance);
double FrechetDistance(const GaussianFit& a, const GaussianFit& b, FrechetForm form = FrechetForm::kAuto);

/// Distance due to sampling alone: mean over `repeats` seeded random halvings of (n, d), n at least 4. Both halves have n
/// / 2 samples, so compare it with distances of sets of that size.
double FrechetSplitHalfFloor(const at::Tensor& x, uint64_t seed = 1, int repeats = 10);

/// Kernel distance: unbiased squared MMD with k(x, y) = (x.y / d + 1)^3. Binkowski et al., "Demystifying MMD GANs", ICLR 2018.
struct KernelDistance {
  double value = 0;           ///< may be negative: the estimator is unbiased
  double standard_error = 0;  ///< delete-one jackknife over both sets
};
/// x: (n1, d), y: (n2, d), at least 3 samples each.
KernelDistance KernelInceptionDistance(const at::Tensor& x, const at::Tensor& y);

/// Distances between two sets of features.
struct SetDistance {
  double fd = 0;     ///< Fréchet distance
  double floor = 0;  ///< mean Fréchet distance of random halves of the first set (n / 2 images each)
  KernelDistance kid;
  int64_t n = 0, n_other = 0, d = 0;
  std::string features;  ///< name of the net; only equal names are comparable
};

/// features (n, d) and (n_other, d) of one net, at least 4 rows each.
SetDistance CompareFeatures(const at::Tensor& reference, const at::Tensor& other, const std::string& name, uint64_t seed);

/// For two sets of images (N, 3, H, W); empty below 4 images or for images under 32 px.
std::optional<SetDistance> CompareSets(const at::Tensor& truth, const at::Tensor& images, const FeatureNet& net, uint64_t seed);

/// Rows of `net` for (N, 3, H, W), a few images at a time: (N, d) float64.
at::Tensor FeatureRows(const FeatureNet& net, const at::Tensor& images);

/// The fixed statistics of avatar/scores/features.h as a net, available on every machine.
std::shared_ptr<const FeatureNet> GaborNet();

}  // namespace mvstudio::avatar
