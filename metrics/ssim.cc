#include "metrics/ssim.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/check.h"
#include "core/parallel.h"

namespace mvstudio::metrics {
namespace {

constexpr int kMaxSide = 11;
constexpr int kRowsPerTask = 32;
constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;

/// A separable window: weight of row i times weight of column j. Symmetric.
struct Kernel {
  int side = 0;
  std::array<double, kMaxSide> weights{};
  double covariance_scale = 1;  ///< n / (n - 1) for sample covariances
};

Kernel MakeKernel(SsimWindow window) {
  Kernel kernel;
  kernel.side = SsimWindowSize(window);
  const int r = kernel.side / 2;
  double sum = 0;
  for (int i = 0; i < kernel.side; ++i) {
    const double weight = window == SsimWindow::kUniform7 ? 1.0 : std::exp(-(i - r) * (i - r) / (2 * 1.5 * 1.5));
    kernel.weights[static_cast<size_t>(i)] = weight;
    sum += weight;
  }
  for (double& weight : kernel.weights) weight /= sum;
  const double n = kernel.side * kernel.side;
  if (window == SsimWindow::kUniform7) kernel.covariance_scale = n / (n - 1);
  return kernel;
}

/// Moments of one row: a, b, a^2 + b^2, ab; each `width` samples, one after the other.
constexpr int kMoments = 4;

// No fused multiply-add in either clone: machines agree to the last bit.
#define MVS_SIMD __attribute__((target_clones("avx2", "default")))

/// Samples to [-1/2, 1/2], whose squares cancel less.
MVS_SIMD void RowMoments(const double* a, const double* b, int width, double scale, double* __restrict out) {
  double *ma = out, *mb = out + width, *sum = out + 2 * width, *product = out + 3 * width;
  for (int x = 0; x < width; ++x) {
    const double va = a[x] * scale - 0.5, vb = b[x] * scale - 0.5;
    ma[x] = va, mb[x] = vb, sum[x] = va * va + vb * vb, product[x] = va * vb;
  }
}

/// out = sum of weights[i] rows[i], `count` samples; rows at equal distance from the middle share a weight.
MVS_SIMD void AddRows11(const double* const* rows, const double* w, int count, double* __restrict out) {
  const double *r0 = rows[0], *r1 = rows[1], *r2 = rows[2], *r3 = rows[3], *r4 = rows[4], *r5 = rows[5], *r6 = rows[6],
               *r7 = rows[7], *r8 = rows[8], *r9 = rows[9], *r10 = rows[10];
  for (int x = 0; x < count; ++x) {
    out[x] = w[0] * (r0[x] + r10[x]) + w[1] * (r1[x] + r9[x]) + w[2] * (r2[x] + r8[x]) + w[3] * (r3[x] + r7[x]) +
             w[4] * (r4[x] + r6[x]) + w[5] * r5[x];
  }
}

MVS_SIMD void AddRows7(const double* const* rows, const double* w, int count, double* __restrict out) {
  const double *r0 = rows[0], *r1 = rows[1], *r2 = rows[2], *r3 = rows[3], *r4 = rows[4], *r5 = rows[5], *r6 = rows[6];
  for (int x = 0; x < count; ++x)
    out[x] = w[0] * (r0[x] + r6[x]) + w[1] * (r1[x] + r5[x]) + w[2] * (r2[x] + r4[x]) + w[3] * r3[x];
}

void AddRows(const double* const* rows, const Kernel& kernel, int count, double* out) {
  (kernel.side == 7 ? AddRows7 : AddRows11)(rows, kernel.weights.data(), count, out);
}

MVS_SIMD void RowSsim(const double* moments, int count, double covariance_scale, double channel_weight, double* out) {
  const double *ma = moments, *mb = ma + count, *sum = mb + count, *product = sum + count;
  for (int x = 0; x < count; ++x) {
    const double mean_product = ma[x] * mb[x], mean_squares = ma[x] * ma[x] + mb[x] * mb[x];
    const double variances = std::max(0.0, sum[x] - mean_squares) * covariance_scale;
    const double covariance = (product[x] - mean_product) * covariance_scale;
    const double a = ma[x] + 0.5, b = mb[x] + 0.5;
    const double value = (2 * a * b + kC1) * (2 * covariance + kC2) / ((a * a + b * b + kC1) * (variances + kC2));
    out[x] += channel_weight * std::min(1.0, std::max(-1.0, value));
  }
}

/// The rows of the map from `begin` to `end`, of all channels. Rows pass once: horizontally on arrival, into a ring of as many
/// as the window is high.
void Rows(const Picture& a, const Picture& b, const Kernel& kernel, int begin, int end, SsimMap* map) {
  const int cols = map->width, side = kernel.side;
  std::vector<double> moments(static_cast<size_t>(kMoments) * a.width), filtered(static_cast<size_t>(kMoments) * cols);
  std::vector<double> ring(static_cast<size_t>(side) * kMoments * cols);
  const auto slot = [&](int row) { return ring.data() + static_cast<size_t>(row % side) * kMoments * cols; };
  const double* rows[kMaxSide];
  for (int channel = 0; channel < a.channels; ++channel) {
    for (int y = begin; y < end + side - 1; ++y) {
      const size_t at = static_cast<size_t>(y) * a.width;
      RowMoments(a.Plane(channel) + at, b.Plane(channel) + at, a.width, 1 / a.range, moments.data());
      for (int m = 0; m < kMoments; ++m) {
        for (int i = 0; i < side; ++i) rows[i] = moments.data() + m * a.width + i;
        AddRows(rows, kernel, cols, slot(y) + m * cols);
      }
      const int top = y - side + 1;
      if (top < begin) continue;
      for (int i = 0; i < side; ++i) rows[i] = slot(top + i);
      AddRows(rows, kernel, kMoments * cols, filtered.data());
      RowSsim(filtered.data(), cols, kernel.covariance_scale, 1.0 / a.channels,
              map->values.data() + static_cast<size_t>(top) * cols);
    }
  }
}

}  // namespace

int SsimWindowSize(SsimWindow window) { return window == SsimWindow::kUniform7 ? 7 : 11; }

SsimMap ComputeSsimMap(const Picture& a, const Picture& b, SsimWindow window, int num_threads) {
  const Kernel kernel = MakeKernel(window);
  SsimMap map;
  map.status = Check(a, b, kernel.side);
  if (map.status != Status::kOk) return map;
  map.border = kernel.side / 2;
  map.width = a.width - kernel.side + 1, map.height = a.height - kernel.side + 1;
  map.values.assign(static_cast<size_t>(map.width) * map.height, 0.0);
  const int tasks = (map.height + kRowsPerTask - 1) / kRowsPerTask;
  ParallelFor(tasks, num_threads, [&](int64_t task) {
    const int begin = static_cast<int>(task) * kRowsPerTask;
    Rows(a, b, kernel, begin, std::min(map.height, begin + kRowsPerTask), &map);
  });
  return map;
}

Score Mean(const SsimMap& map) { return Mean(map, Box{0, 0, map.width + 2 * map.border, map.height + 2 * map.border}); }

Score Mean(const SsimMap& map, const Box& box) {
  if (map.status != Status::kOk) return {map.status};
  const int x0 = std::max(0, box.x0), x1 = std::min(map.width, box.x1 - 2 * map.border);
  const int y0 = std::max(0, box.y0), y1 = std::min(map.height, box.y1 - 2 * map.border);
  if (x1 <= x0 || y1 <= y0) return {Status::kNothingLeft};
  double sum = 0;
  for (int y = y0; y < y1; ++y) {
    const double* row = map.values.data() + static_cast<size_t>(y) * map.width;
    for (int x = x0; x < x1; ++x) sum += row[x];
  }
  return {Status::kOk, sum / (static_cast<double>(x1 - x0) * (y1 - y0))};
}

Score Mean(const SsimMap& map, const Mask& mask) {
  if (map.status != Status::kOk) return {map.status};
  const size_t stride = static_cast<size_t>(map.width) + 2 * map.border;
  MVS_CHECK(mask.size() == stride * (static_cast<size_t>(map.height) + 2 * map.border), "the mask has another size");
  double sum = 0;
  int64_t count = 0;
  for (int y = 0; y < map.height; ++y) {
    const uint8_t* inside = mask.data() + (static_cast<size_t>(y) + map.border) * stride + map.border;
    const double* row = map.values.data() + static_cast<size_t>(y) * map.width;
    for (int x = 0; x < map.width; ++x) {
      if (inside[x]) sum += row[x], ++count;
    }
  }
  if (count == 0) return {Status::kNothingLeft};
  return {Status::kOk, sum / static_cast<double>(count)};
}

Score Ssim(const Picture& a, const Picture& b, SsimWindow window, int num_threads) {
  return Mean(ComputeSsimMap(a, b, window, num_threads));
}

}  // namespace mvstudio::metrics
