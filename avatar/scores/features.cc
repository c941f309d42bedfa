#include "avatar/scores/features.h"

#include <ATen/ATen.h>
#include <ATen/Parallel.h>

#include <cmath>
#include <vector>

#include "core/check.h"
#include "core/units.h"

namespace mvstudio::avatar {
namespace {

constexpr int kOctaves = 4;
constexpr int kOrientations = 6;
constexpr int kKernelPx = 9;
constexpr double kFloor = 1e-3;  // a quarter of a grey level: keeps the logarithm of empty regions finite

// (12, 1, 9, 9): even filters of the 6 orientations, then odd ones; zero mean, unit L1 norm.
at::Tensor GaborBank() {
  at::Tensor bank = at::zeros({2 * kOrientations, 1, kKernelPx, kKernelPx}, at::kDouble);
  at::Tensor envelope = at::zeros({kKernelPx, kKernelPx}, at::kDouble);
  auto k = bank.accessor<double, 4>();
  auto e = envelope.accessor<double, 2>();
  constexpr int r = kKernelPx / 2;
  for (int o = 0; o < kOrientations; ++o) {
    const double angle = kPi * o / kOrientations;
    for (int y = -r; y <= r; ++y) {
      for (int x = -r; x <= r; ++x) {
        const double phase = 2 * kPi / 4.0 * (x * std::cos(angle) + y * std::sin(angle));
        e[y + r][x + r] = std::exp(-(x * x + y * y) / (2 * 2.0 * 2.0));
        k[o][0][y + r][x + r] = e[y + r][x + r] * std::cos(phase);
        k[o + kOrientations][0][y + r][x + r] = e[y + r][x + r] * std::sin(phase);
      }
    }
  }
  bank -= bank.sum({2, 3}, true) / envelope.sum() * envelope;
  return bank / bank.abs().sum({2, 3}, true);
}

// Y, R - G, (R + G) / 2 - B: (N, 3, H, W) -> (N, 3, H, W).
at::Tensor Opponent(const at::Tensor& rgb) {
  const at::Tensor r = rgb.select(1, 0), g = rgb.select(1, 1), b = rgb.select(1, 2);
  return at::stack({0.299 * r + 0.587 * g + 0.114 * b, r - g, (r + g) / 2 - b}, 1);
}

// Magnitudes of the Gabor responses: (N, 3, H, W) -> (N, 3, 6, H, W). Filtered in float32 (ten times as fast), the statistics
// of the result are taken in float64.
at::Tensor Magnitudes(const at::Tensor& x, const at::Tensor& bank) {
  const int64_t n = x.size(0), height = x.size(2), width = x.size(3);
  const at::Tensor padded = at::replication_pad2d(x.reshape({n * 3, 1, height, width}), {4, 4, 4, 4});
  const at::Tensor y = at::conv2d(padded.to(at::kFloat), bank.to(at::kFloat)).view({n, 3, 2, kOrientations, height, width});
  return (y.select(2, 0).square() + y.select(2, 1).square()).sqrt().to(at::kDouble);
}

// Halves an image (N, C, H, W) after a binomial blur (1 4 6 4 1) / 16.
at::Tensor Halve(const at::Tensor& x) {
  const at::Tensor row = at::tensor({1.0, 4.0, 6.0, 4.0, 1.0}, at::kDouble) / 16;
  const at::Tensor kernel = at::outer(row, row).view({1, 1, 5, 5});
  const at::Tensor flat = x.reshape({x.size(0) * x.size(1), 1, x.size(2), x.size(3)});
  const at::Tensor y = at::conv2d(at::replication_pad2d(flat, {2, 2, 2, 2}), kernel, {}, 2);
  return y.view({x.size(0), x.size(1), y.size(2), y.size(3)});
}

// Correlation of the pixels of a and b, (N, K, H, W) each -> (N, K); near 0 where one of them is flat.
at::Tensor Correlation(const at::Tensor& a, const at::Tensor& b) {
  const at::Tensor da = a - a.mean({2, 3}, true), db = b - b.mean({2, 3}, true);
  const at::Tensor va = da.square().mean({2, 3}), vb = db.square().mean({2, 3});
  return (da * db).mean({2, 3}) / ((va + kFloor * kFloor) * (vb + kFloor * kFloor)).sqrt();
}

// Correlations of all pairs i < j of the second dimension: (N, K, H, W) -> (N, K (K - 1) / 2).
at::Tensor PairCorrelations(const at::Tensor& m) {
  std::vector<int64_t> first, second;
  for (int64_t i = 0; i < m.size(1); ++i) {
    for (int64_t j = i + 1; j < m.size(1); ++j) first.push_back(i), second.push_back(j);
  }
  return Correlation(m.index_select(1, at::tensor(first, at::kLong)), m.index_select(1, at::tensor(second, at::kLong)));
}

at::Tensor LogMeanStd(const at::Tensor& m) {
  const at::Tensor mean = m.mean({3, 4}), deviation = (m - m.mean({3, 4}, true)).square().mean({3, 4}).sqrt();
  return at::cat({(mean + kFloor).log().flatten(1), (deviation + kFloor).log().flatten(1)}, 1);
}

at::Tensor Features(const at::Tensor& rgb, const at::Tensor& bank) {
  at::Tensor x = Opponent(rgb), finer;
  const at::Tensor marginals = at::cat({x.mean({2, 3}), (x - x.mean({2, 3}, true)).square().mean({2, 3}).sqrt()}, 1);
  std::vector<at::Tensor> energy, orientations, octaves, channels;
  for (int s = 0; s < kOctaves; ++s) {
    const at::Tensor m = Magnitudes(x, bank), luma = m.select(1, 0);
    energy.push_back(LogMeanStd(m));
    orientations.push_back(PairCorrelations(luma));
    channels.push_back(PairCorrelations(m.sum(2)));
    if (s > 0) octaves.push_back(Correlation(Halve(finer), luma));
    finer = luma;
    x = Halve(x);
  }
  return at::cat({at::cat(energy, 1), at::cat(orientations, 1), at::cat(octaves, 1), at::cat(channels, 1), marginals}, 1);
}

}  // namespace

at::Tensor GaborFeatures(const at::Tensor& images) {
  MVS_CHECK(images.defined() && images.dim() == 4 && images.size(1) == 3, "images must be (N, 3, H, W)");
  MVS_CHECK(images.size(0) > 0 && images.size(2) >= kGaborFeatureMinPx && images.size(3) >= kGaborFeatureMinPx,
            "images must be at least 32x32, are " << images.sizes());
  const at::Tensor x = images.detach().to(at::kCPU, at::kDouble);
  MVS_CHECK(at::isfinite(x).all().item<bool>(), "images hold NaN or infinity");
  const at::Tensor bank = GaborBank();
  std::vector<at::Tensor> rows(x.size(0));
  at::parallel_for(0, x.size(0), 1,
                   [&](int64_t begin, int64_t end) {  // one image a thread: what is called inside runs serially
                     const at::NoGradGuard no_grad;
                     for (int64_t i = begin; i < end; ++i) rows[i] = Features(x.slice(0, i, i + 1), bank);
                   });
  return at::cat(rows, 0);
}

}  // namespace mvstudio::avatar
