#include "avatar/metrics.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/check.h"
#include "core/random.h"

namespace mvstudio::avatar {
namespace {

constexpr double kC1 = 0.01 * 0.01;
constexpr double kC2 = 0.03 * 0.03;
constexpr double kSlack = 1e-6;  // how far outside [0, 1] a value may lie

at::Tensor AsFloat64(const at::Tensor& x, const char* name, int64_t dims) {
  MVS_CHECK(x.defined() && x.dim() == dims, name << " must have " << dims << " dimensions");
  const at::Tensor y = x.detach().to(at::kCPU, at::kDouble).contiguous();
  MVS_CHECK(y.numel() > 0, name << " is empty");
  MVS_CHECK(at::isfinite(y).all().item<bool>(), name << " holds NaN or infinity");
  return y;
}

at::Tensor AsPictures(const at::Tensor& x, const char* name) {
  const at::Tensor y = AsFloat64(x, name, 4);
  MVS_CHECK(y.min().item<double>() >= -kSlack && y.max().item<double>() <= 1 + kSlack,
            name << " must lie in [0, 1], is in [" << y.min().item<double>() << ", " << y.max().item<double>() << "]");
  return y;
}

at::Tensor Luma(const at::Tensor& x) {
  if (x.size(1) == 1) return x;
  MVS_CHECK(x.size(1) == 3, "luma needs 1 or 3 channels, got " << x.size(1));
  return (0.299 * x.select(1, 0) + 0.587 * x.select(1, 1) + 0.114 * x.select(1, 2)).unsqueeze(1).contiguous();
}

std::array<double, kSsimWindow * kSsimWindow> GaussianWindow() {
  std::array<double, kSsimWindow * kSsimWindow> w{};
  double sum = 0;
  constexpr int r = kSsimWindow / 2;
  for (int y = -r; y <= r; ++y) {
    for (int x = -r; x <= r; ++x) sum += w[(y + r) * kSsimWindow + x + r] = std::exp(-(x * x + y * y) / (2 * 1.5 * 1.5));
  }
  for (double& v : w) v /= sum;
  return w;
}

// SSIM of the `cols` windows whose top-left pixels are a[0 ..), b[0 ..) in rows of `stride` pixels. Loops over windows are
// innermost, so that the compiler can vectorise them.
void RowSsim(const double* a, const double* b, int64_t stride, int64_t cols, const double* w, double* out) {
  std::vector<double> sums(5 * cols, 0.0);
  double *mean_a = sums.data(), *mean_b = mean_a + cols, *var_a = mean_b + cols, *var_b = var_a + cols, *cov = var_b + cols;
  for (int k = 0; k < kSsimWindow * kSsimWindow; ++k) {
    const double *pa = a + (k / kSsimWindow) * stride + k % kSsimWindow, *pb = b + (pa - a);
    for (int64_t c = 0; c < cols; ++c) mean_a[c] += w[k] * pa[c], mean_b[c] += w[k] * pb[c];
  }
  for (int k = 0; k < kSsimWindow * kSsimWindow; ++k) {
    const double *pa = a + (k / kSsimWindow) * stride + k % kSsimWindow, *pb = b + (pa - a);
    for (int64_t c = 0; c < cols; ++c) {
      const double da = pa[c] - mean_a[c], db = pb[c] - mean_b[c];
      var_a[c] += w[k] * da * da, var_b[c] += w[k] * db * db, cov[c] += w[k] * da * db;
    }
  }
  for (int64_t c = 0; c < cols; ++c) {
    const double value = (2 * mean_a[c] * mean_b[c] + kC1) * (2 * cov[c] + kC2) /
                         ((mean_a[c] * mean_a[c] + mean_b[c] * mean_b[c] + kC1) * (var_a[c] + var_b[c] + kC2));
    out[c] = std::min(1.0, std::max(-1.0, value));
  }
}

// Centred samples over sqrt(n - 1): their Gram matrix is the covariance.
at::Tensor Centred(const at::Tensor& x, const at::Tensor& mean) {
  return (x - mean) / std::sqrt(static_cast<double>(x.size(0) - 1));
}

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
  if (form == FrechetForm::kNuclear) return at::linalg_svdvals(x.matmul(y.t())).sum().item<double>();
  const at::Tensor rx = std::get<1>(at::linalg_qr(x, "r")), ry = std::get<1>(at::linalg_qr(y, "r"));
  return at::linalg_svdvals(rx.matmul(ry.t())).sum().item<double>();
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

at::Tensor SsimMap(const at::Tensor& a, const at::Tensor& b, SsimChannels channels) {
  at::Tensor x = AsPictures(a, "a"), y = AsPictures(b, "b");
  MVS_CHECK(x.sizes() == y.sizes(), "pictures of different sizes: " << x.sizes() << " and " << y.sizes());
  MVS_CHECK(x.size(2) >= kSsimWindow && x.size(3) >= kSsimWindow, "pictures must be at least 11x11, are " << x.sizes());
  if (channels == SsimChannels::kLuma) x = Luma(x), y = Luma(y);
  const int64_t planes = x.size(0) * x.size(1), height = x.size(2), width = x.size(3);
  const int64_t rows = height - kSsimWindow + 1, cols = width - kSsimWindow + 1;
  const auto window = GaussianWindow();
  at::Tensor map = at::empty({x.size(0), x.size(1), rows, cols}, at::kDouble);
  const double *px = x.data_ptr<double>(), *py = y.data_ptr<double>();
  double* out = map.data_ptr<double>();
  at::parallel_for(0, planes * rows, 16, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const int64_t offset = (i / rows) * height * width + (i % rows) * width;
      RowSsim(px + offset, py + offset, width, cols, window.data(), out + i * cols);
    }
  });
  return map.mean(1);
}

at::Tensor Ssim(const at::Tensor& a, const at::Tensor& b, SsimChannels channels) {
  return SsimMap(a, b, channels).mean({1, 2});
}

at::Tensor PsnrDb(const at::Tensor& a, const at::Tensor& b, const at::Tensor& mask) {
  const at::Tensor x = AsPictures(a, "a"), y = AsPictures(b, "b");
  MVS_CHECK(x.sizes() == y.sizes(), "pictures of different sizes: " << x.sizes() << " and " << y.sizes());
  const at::Tensor error = (x - y).square().mean(1);
  if (!mask.defined()) return -10 * error.mean({1, 2}).log10();
  const at::Tensor inside = AsFloat64(mask, "mask", 3).ne(0).to(at::kDouble);
  MVS_CHECK(inside.sizes() == error.sizes(), "mask of size " << inside.sizes() << " for pictures of " << x.sizes());
  const at::Tensor count = inside.sum({1, 2});
  MVS_CHECK(count.gt(0).all().item<bool>(), "a mask is empty");
  return -10 * ((error * inside).sum({1, 2}) / count).log10();
}

PsnrSummary MeanPsnr(const std::vector<double>& psnr_db) {
  MVS_CHECK(!psnr_db.empty(), "no pictures");
  PsnrSummary summary;
  double sum = 0;
  for (const double value : psnr_db) {
    MVS_CHECK(!std::isnan(value), "PSNR is NaN");
    if (std::isinf(value)) {
      ++summary.num_infinite;
    } else {
      sum += value;
    }
  }
  const auto finite = static_cast<int64_t>(psnr_db.size()) - summary.num_infinite;
  summary.mean_db = finite > 0 ? sum / static_cast<double>(finite) : std::numeric_limits<double>::infinity();
  return summary;
}

at::Tensor MaskIou(const at::Tensor& a, const at::Tensor& b) {
  const at::Tensor x = AsFloat64(a, "a", 3).ge(0.5), y = AsFloat64(b, "b", 3).ge(0.5);
  MVS_CHECK(x.sizes() == y.sizes(), "masks of different sizes: " << x.sizes() << " and " << y.sizes());
  const at::Tensor both = x.logical_and(y).sum({1, 2}).to(at::kDouble), any = x.logical_or(y).sum({1, 2}).to(at::kDouble);
  return at::where(any > 0, both / any.clamp_min(1), at::ones_like(any));
}

double FrechetDistance(const at::Tensor& x, const at::Tensor& y, FrechetForm form) {
  const at::Tensor a = AsFloat64(x, "x", 2), b = AsFloat64(y, "y", 2);
  MVS_CHECK(a.size(1) == b.size(1), "features of different length: " << a.size(1) << " and " << b.size(1));
  MVS_CHECK(a.size(0) >= 2 && b.size(0) >= 2, "a covariance needs 2 samples, got " << a.size(0) << " and " << b.size(0));
  const at::Tensor mean_a = a.mean(0), mean_b = b.mean(0);
  const at::Tensor ca = Centred(a, mean_a), cb = Centred(b, mean_b);
  if (form == FrechetForm::kAuto) form = std::max(a.size(0), b.size(0)) <= a.size(1) ? FrechetForm::kNuclear : FrechetForm::kQr;
  const double value = (mean_a - mean_b).square().sum().item<double>() + ca.square().sum().item<double>() +
                       cb.square().sum().item<double>() - 2 * CrossTerm(ca, cb, form);
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

}  // namespace mvstudio::avatar
