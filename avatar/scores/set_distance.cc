#include "avatar/scores/set_distance.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "avatar/scores/features.h"
#include "avatar/scores/nuclear_norm.h"
#include "core/check.h"
#include "core/random.h"

namespace mvstudio::avatar {
namespace {

at::Tensor AsFloat64(const at::Tensor& x, const char* name, int64_t dims) {
  MVS_CHECK(x.defined() && x.dim() == dims, name << " must have " << dims << " dimensions");
  const at::Tensor y = x.detach().to(at::kCPU, at::kDouble).contiguous();
  MVS_CHECK(y.numel() > 0, name << " is empty");
  if (!std::isfinite(y.sum().item<double>())) {  // may also be the overflow of a sum
    MVS_CHECK(at::isfinite(y).all().item<bool>(), name << " holds NaN or infinity");
  }
  return y;
}

// Centred samples over sqrt(n - 1): their Gram matrix is the covariance.
at::Tensor Centred(const at::Tensor& x, const at::Tensor& mean) {
  return (x - mean).div_(std::sqrt(static_cast<double>(x.size(0) - 1)));
}

// Row by row, without a copy of the squares.
double SumOfSquares(const at::Tensor& x) { return x.norm(2, {1}).square().sum().item<double>(); }

at::Tensor SymmetricSqrt(const at::Tensor& s) {
  const auto [values, vectors] = at::linalg_eigh(s);
  return vectors.matmul(values.clamp_min(0).sqrt().unsqueeze(1) * vectors.t());
}

// tr (S1 S2)^(1/2) from the centred samples.
double CrossTerm(const at::Tensor& x, const at::Tensor& y, FrechetForm form) {
  if (form == FrechetForm::kEigen) {
    const at::Tensor root = SymmetricSqrt(x.t().matmul(x));
    const at::Tensor product = root.matmul(y.t().matmul(y)).matmul(root);
    return at::linalg_eigvalsh((product + product.t()) / 2).clamp_min(0).sqrt().sum().item<double>();
  }
  if (form == FrechetForm::kNuclear) return NuclearNorm(x.matmul(y.t()));
  const at::Tensor rx = std::get<1>(at::linalg_qr(x, "r")), ry = std::get<1>(at::linalg_qr(y, "r"));
  return NuclearNorm(rx.matmul(ry.t()));
}

double SumOffDiagonal(const at::Tensor& k) { return (k.sum() - k.diagonal().sum()).item<double>(); }

at::Tensor CubicKernel(const at::Tensor& x, const at::Tensor& y) {
  return (x.matmul(y.t()) / static_cast<double>(x.size(1)) + 1).pow(3);
}

// Variance of a statistic by the jackknife: (n - 1) / n * sum (value_without_i - mean)^2.
double JackknifeVariance(const at::Tensor& left_out) {
  const double n = static_cast<double>(left_out.size(0));
  return (n - 1) / n * (left_out - left_out.mean()).square().sum().item<double>();
}

}  // namespace

GaussianFit FitGaussian(const at::Tensor& x) {
  const at::Tensor a = AsFloat64(x, "x", 2);
  MVS_CHECK(a.size(0) >= 2, "a covariance needs 2 samples, got " << a.size(0));
  const at::Tensor mean = a.mean(0);
  return {mean, Centred(a, mean)};
}

GaussianFit GaussianOf(const at::Tensor& mean, const at::Tensor& covariance) {
  const at::Tensor m = AsFloat64(mean, "mean", 1), s = AsFloat64(covariance, "covariance", 2);
  MVS_CHECK(s.size(0) == m.size(0) && s.size(1) == m.size(0),
            "a mean of " << m.size(0) << " and a covariance of " << s.size(0));
  const auto [values, vectors] = at::linalg_eigh((s + s.t()) / 2);
  return {m, (vectors * values.clamp_min(0).sqrt()).t().contiguous()};
}

double FrechetDistance(const at::Tensor& x, const at::Tensor& y, FrechetForm form) {
  return FrechetDistance(FitGaussian(x), FitGaussian(y), form);
}

double FrechetDistance(const GaussianFit& a, const GaussianFit& b, FrechetForm form) {
  MVS_CHECK(a.mean.size(0) == b.mean.size(0), "features of different length: " << a.mean.size(0) << " and " << b.mean.size(0));
  const bool few = std::max(a.root.size(0), b.root.size(0)) <= a.mean.size(0);
  if (form == FrechetForm::kAuto) form = few ? FrechetForm::kNuclear : FrechetForm::kQr;
  const double value = (a.mean - b.mean).square().sum().item<double>() + SumOfSquares(a.root) + SumOfSquares(b.root) -
                       2 * CrossTerm(a.root, b.root, form);
  return form == FrechetForm::kEigen ? value : std::max(0.0, value);
}

double FrechetSplitHalfFloor(const at::Tensor& x, uint64_t seed, int repeats) {
  const at::Tensor a = AsFloat64(x, "x", 2);
  const int64_t n = a.size(0), half = n / 2;
  MVS_CHECK(n >= 4 && repeats >= 1,
            "two halves of at least 2 samples are needed, got " << n << " samples, " << repeats << " repeats");
  Rng rng(seed);
  std::vector<int64_t> order(n);
  for (int64_t i = 0; i < n; ++i) order[i] = i;
  double sum = 0;
  for (int r = 0; r < repeats; ++r) {
    for (int64_t i = n - 1; i > 0; --i) std::swap(order[i], order[rng.Index(i + 1)]);
    const at::Tensor index = at::tensor(order, at::kLong);
    sum += FrechetDistance(a.index_select(0, index.slice(0, 0, half)), a.index_select(0, index.slice(0, half, 2 * half)));
  }
  return sum / repeats;
}

KernelDistance KernelInceptionDistance(const at::Tensor& x, const at::Tensor& y) {
  const at::Tensor a = AsFloat64(x, "x", 2), b = AsFloat64(y, "y", 2);
  MVS_CHECK(a.size(1) == b.size(1), "features of different length: " << a.size(1) << " and " << b.size(1));
  MVS_CHECK(a.size(0) >= 3 && b.size(0) >= 3, "at least 3 samples are needed, got " << a.size(0) << " and " << b.size(0));
  const double n = static_cast<double>(a.size(0)), m = static_cast<double>(b.size(0));
  const at::Tensor kaa = CubicKernel(a, a), kbb = CubicKernel(b, b), kab = CubicKernel(a, b);
  const double saa = SumOffDiagonal(kaa), sbb = SumOffDiagonal(kbb), sab = kab.sum().item<double>();
  const at::Tensor without_a = (saa - 2 * (kaa.sum(1) - kaa.diagonal())) / ((n - 1) * (n - 2)) + sbb / (m * (m - 1)) -
                               2 * (sab - kab.sum(1)) / ((n - 1) * m);
  const at::Tensor without_b = saa / (n * (n - 1)) + (sbb - 2 * (kbb.sum(1) - kbb.diagonal())) / ((m - 1) * (m - 2)) -
                               2 * (sab - kab.sum(0)) / (n * (m - 1));
  return {saa / (n * (n - 1)) + sbb / (m * (m - 1)) - 2 * sab / (n * m),
          std::sqrt(JackknifeVariance(without_a) + JackknifeVariance(without_b))};
}

SetDistance CompareFeatures(const at::Tensor& reference, const at::Tensor& other, const std::string& name, uint64_t seed) {
  return {FrechetDistance(reference, other),
          FrechetSplitHalfFloor(reference, seed),
          KernelInceptionDistance(reference, other),
          reference.size(0),
          other.size(0),
          reference.size(1),
          name};
}

at::Tensor FeatureRows(const FeatureNet& net, const at::Tensor& images) {
  constexpr int64_t kAtATime = 16;
  const at::NoGradGuard no_gradients;
  std::vector<at::Tensor> rows;
  for (int64_t i = 0; i < images.size(0); i += kAtATime)
    rows.push_back(net.Pooled(images.slice(0, i, std::min(images.size(0), i + kAtATime))).to(at::kDouble));
  return at::cat(rows);
}

std::optional<SetDistance> CompareSets(const at::Tensor& truth, const at::Tensor& images, const FeatureNet& net,
                                       uint64_t seed) {
  if (truth.size(0) < 4 || std::min(truth.size(2), truth.size(3)) < kGaborFeatureMinPx) return std::nullopt;
  return CompareFeatures(FeatureRows(net, truth), FeatureRows(net, images), net.name(), seed);
}

std::shared_ptr<const FeatureNet> GaborNet() {
  class Net : public FeatureNet {
   public:
    std::string name() const override { return kGaborFeatureName; }
    std::vector<at::Tensor> Levels(const at::Tensor& rgb) const override { return {GaborFeatures(rgb)}; }
  };
  return std::make_shared<Net>();
}

}  // namespace mvstudio::avatar
