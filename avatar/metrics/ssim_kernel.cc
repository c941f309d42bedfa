#include "avatar/metrics/ssim_kernel.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "avatar/metrics/simd.h"
#include "avatar/metrics/ssim_window.h"

namespace mvstudio::metrics {
namespace {

constexpr int kMaxSide = kWangSide, kMaxInput = kSsimStrip + kMaxSide - 1;

/// Of one row, at distances of kSsimStrip: a, b, a^2 + b^2, ab.
constexpr int kMoments = 4;
using RowMoments = std::array<double, kMoments * kSsimStrip>;

/// A separable window: weight of row i times weight of column j, the same from both ends.
struct Kernel {
  std::array<double, kMaxSide / 2 + 1> weights{};  // from the end to the middle
  double covariance_scale = 1;                     // n / (n - 1) for sample covariances
};

Kernel MakeKernel(SsimWindow window) {
  Kernel kernel;
  if (window == SsimWindow::kUniform7) {
    kernel.weights.fill(1.0 / 7);
    kernel.covariance_scale = 49.0 / 48;
    return kernel;
  }
  const std::array<double, kWangSide> weights = WangWeights();
  std::copy_n(weights.begin(), kernel.weights.size(), kernel.weights.begin());
  return kernel;
}

MVS_SIMD void LoadPlane(const double* in, int count, double scale, double* __restrict out) {
  for (int x = 0; x < count; ++x) out[x] = in[x] * scale - 0.5;
}

MVS_SIMD void LoadLuma(const double* r, const double* g, const double* b, int count, double scale, double* __restrict out) {
  for (int x = 0; x < count; ++x) out[x] = (0.299 * r[x] + 0.587 * g[x] + 0.114 * b[x]) * scale - 0.5;
}

MVS_SIMD void LoadBytes3(const uint8_t* in, int count, double scale, double* __restrict out) {
  for (int x = 0; x < count; ++x) out[x] = in[3 * x] * scale - 0.5;
}

void LoadBytes(const uint8_t* in, int step, int count, double scale, double* out) {
  for (int x = 0; x < count; ++x) out[x] = in[static_cast<ptrdiff_t>(step) * x] * scale - 0.5;
}

MVS_SIMD void LoadLumaBytes(const uint8_t* in, int count, double scale, double* __restrict out) {
  for (int x = 0; x < count; ++x) out[x] = (0.299 * in[3 * x] + 0.587 * in[3 * x + 1] + 0.114 * in[3 * x + 2]) * scale - 0.5;
}

/// Samples to [-1/2, 1/2], whose squares cancel less.
void Load(const Samples& s, int channel, int y, int x0, int count, double* out) {
  const size_t at = static_cast<size_t>(y) * s.width + x0, plane = static_cast<size_t>(s.width) * s.height;
  const double scale = 1 / s.range;
  if (s.planes && s.luma) return LoadLuma(s.planes + at, s.planes + plane + at, s.planes + 2 * plane + at, count, scale, out);
  if (s.planes) return LoadPlane(s.planes + plane * channel + at, count, scale, out);
  if (s.luma) return LoadLumaBytes(s.bytes + 3 * at, count, scale, out);
  if (s.channels == 3) return LoadBytes3(s.bytes + 3 * at + channel, count, scale, out);
  LoadBytes(s.bytes + s.channels * at + channel, s.channels, count, scale, out);
}

/// Weighted sum of kSide numbers, those at equal distance from the middle together; sample(i) is number i.
template <int kSide, class Sample>
MVS_INLINE double Filter(const double* w, const Sample& sample) {
  if constexpr (kSide == 7) {
    return w[0] * (((sample(0) + sample(6)) + (sample(1) + sample(5))) + ((sample(2) + sample(4)) + sample(3)));
  } else {
    return ((w[0] * (sample(0) + sample(10)) + w[1] * (sample(1) + sample(9))) +
            (w[2] * (sample(2) + sample(8)) + w[3] * (sample(3) + sample(7)))) +
           (w[4] * (sample(4) + sample(6)) + w[5] * sample(5));
  }
}

/// One row of both images, count + kSide - 1 samples, to its moments in windows one row high.
template <int kSide>
MVS_INLINE void FilterAcross(const double* a, const double* b, const double* w, int count, double* __restrict out) {
  double sum[kMaxInput], product[kMaxInput];
  for (int x = 0; x < count + kSide - 1; ++x) sum[x] = a[x] * a[x] + b[x] * b[x], product[x] = a[x] * b[x];
  const double* inputs[kMoments] = {a, b, sum, product};
  for (int m = 0; m < kMoments; ++m) {
    const double* in = inputs[m];
    for (int x = 0; x < count; ++x) out[m * kSsimStrip + x] = Filter<kSide>(w, [in, x](int i) { return in[x + i]; });
  }
}

struct Moments {
  double a, b, sum, product;
};

MVS_INLINE double SsimOf(const Moments& m, double covariance_scale) {
  const double mean_product = m.a * m.b, mean_squares = m.a * m.a + m.b * m.b;
  const double variances = std::max(0.0, m.sum - mean_squares) * covariance_scale;
  const double covariance = (m.product - mean_product) * covariance_scale;
  const double a = m.a + 0.5, b = m.b + 0.5;
  return (2 * a * b + kSsimC1) * (2 * covariance + kSsimC2) / ((a * a + b * b + kSsimC1) * (variances + kSsimC2));
}

/// Rounding may leave a value outside by some 1e-16.
MVS_INLINE double Clamp(double value) {
  const double low = value < -1 ? -1 : value;
  return low > 1 ? 1 : low;
}

/// kSide rows of moments, from the top, to the SSIM of the windows over them.
template <int kSide>
MVS_INLINE void FilterDown(const double* const* rows, const double* w, double covariance_scale, double weight, int count,
                           double* __restrict out) {
  const double* r[kSide];
  for (int i = 0; i < kSide; ++i) r[i] = rows[i];
  double values[kSsimStrip];
  for (int x = 0; x < count; ++x) {
    const auto moment = [&](int m) { return Filter<kSide>(w, [&](int i) { return r[i][m * kSsimStrip + x]; }); };
    values[x] = SsimOf({moment(0), moment(1), moment(2), moment(3)}, covariance_scale);
  }
  for (int x = 0; x < count; ++x) values[x] = Clamp(values[x]);
  for (int x = 0; x < count; ++x) out[x] += weight * values[x];
}

MVS_SIMD void Across7(const double* a, const double* b, const double* w, int count, double* out) {
  FilterAcross<7>(a, b, w, count, out);
}
MVS_SIMD void Across11(const double* a, const double* b, const double* w, int count, double* out) {
  FilterAcross<11>(a, b, w, count, out);
}
MVS_SIMD void Down7(const double* const* rows, const double* w, double scale, double weight, int count, double* out) {
  FilterDown<7>(rows, w, scale, weight, count, out);
}
MVS_SIMD void Down11(const double* const* rows, const double* w, double scale, double weight, int count, double* out) {
  FilterDown<11>(rows, w, scale, weight, count, out);
}

}  // namespace

Samples SamplesOf(const PlanarImage& planar) {
  return {planar.samples.data(), nullptr, planar.width, planar.height, planar.channels, planar.range, false};
}

Samples SamplesOf(const Image& image) {
  return {nullptr, image.pixels.data(), image.width, image.height, image.channels, 255, false};
}

void AddSsimStrip(const Samples& a, const Samples& b, SsimWindow window, int x0, int count, double weight, double* out,
                  int64_t stride) {
  const Kernel kernel = MakeKernel(window);
  const int side = SsimWindowSize(window);
  const auto across = side == 7 ? Across7 : Across11;
  const auto down = side == 7 ? Down7 : Down11;
  double row_a[kMaxInput], row_b[kMaxInput];
  std::array<RowMoments, kMaxSide> ring;  // row y is in place y % side
  const double* rows[kMaxSide];
  for (int channel = 0; channel < a.NumPlanes(); ++channel) {
    for (int y = 0; y < a.height; ++y) {
      Load(a, channel, y, x0, count + side - 1, row_a);
      Load(b, channel, y, x0, count + side - 1, row_b);
      across(row_a, row_b, kernel.weights.data(), count, ring[y % side].data());
      const int top = y - side + 1;
      if (top < 0) continue;
      for (int i = 0; i < side; ++i) rows[i] = ring[(top + i) % side].data();
      down(rows, kernel.weights.data(), kernel.covariance_scale, weight, count, out + top * stride);
    }
  }
}

std::array<double, kWangSide> WangWeights() {
  constexpr int kRadius = kWangSide / 2;
  constexpr double kSigma = 1.5;
  std::array<double, kWangSide> weights;
  double sum = 0;
  for (int i = 0; i <= kRadius; ++i) {
    weights[i] = weights[kWangSide - 1 - i] = std::exp(-(i - kRadius) * (i - kRadius) / (2 * kSigma * kSigma));
    sum += (i < kRadius ? 2 : 1) * weights[i];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

}  // namespace mvstudio::metrics
