#include "avatar/splats/train/ssim_gradient.h"

#include <algorithm>
#include <array>

#include "avatar/metrics/simd.h"
#include "avatar/metrics/ssim_window.h"

namespace mvstudio::splats {
namespace {

constexpr int kSide = metrics::kWangSide;
constexpr double kC1 = metrics::kSsimC1, kC2 = metrics::kSsimC2;

template <class S>
std::array<S, kSide> Weights() {
  const std::array<double, kSide> weights = metrics::WangWeights();
  std::array<S, kSide> out;
  std::transform(weights.begin(), weights.end(), out.begin(), [](double weight) { return S(weight); });
  return out;
}

/// Planes of a box of `width` x `height` samples; windows lie at (width - 10) x (height - 10) places.
template <class S>
struct Blur {
  int width, height;
  std::array<S, kSide> weights = Weights<S>();
  std::vector<S> rows;  // scratch

  int across() const { return width - kSide + 1; }
  int down() const { return height - kSide + 1; }
};

/// Weighted means of the windows: (height, width) -> (down, across).
template <class S>
MVS_INLINE void Means(Blur<S>* blur, const S* in, S* __restrict out) {
  const int across = blur->across(), down = blur->down();
  S* __restrict rows = blur->rows.data();
  for (int y = 0; y < blur->height; ++y) {
    for (int x = 0; x < across; ++x) {
      S sum = 0;
      for (int k = 0; k < kSide; ++k) sum += blur->weights[k] * in[y * blur->width + x + k];
      rows[y * across + x] = sum;
    }
  }
  for (int y = 0; y < down; ++y) {
    for (int x = 0; x < across; ++x) {
      S sum = 0;
      for (int k = 0; k < kSide; ++k) sum += blur->weights[k] * rows[(y + k) * across + x];
      out[y * across + x] = sum;
    }
  }
}

/// The transposed map: (down, across) -> (height, width).
template <class S>
MVS_INLINE void Spread(Blur<S>* blur, const S* in, S* __restrict out) {
  const int across = blur->across(), down = blur->down(), width = blur->width;
  S* __restrict rows = blur->rows.data();
  for (int i = 0; i < blur->height * across; ++i) rows[i] = 0;
  for (int y = 0; y < down; ++y)
    for (int k = 0; k < kSide; ++k)
      for (int x = 0; x < across; ++x) rows[(y + k) * across + x] += blur->weights[k] * in[y * across + x];
  for (int i = 0; i < blur->height * width; ++i) out[i] = 0;
  for (int y = 0; y < blur->height; ++y)
    for (int k = 0; k < kSide; ++k)
      for (int x = 0; x < across; ++x) out[y * width + x + k] += blur->weights[k] * rows[y * across + x];
}

/// SSIM of each window, from its means of x, y, x^2, y^2, xy; then these hold the derivatives by the means of x, x^2, xy.
template <class S>
MVS_INLINE void Scores(int count, S* __restrict x, const S* __restrict y, S* __restrict xx, const S* __restrict yy,
                       S* __restrict xy, S* __restrict score) {
  for (int i = 0; i < count; ++i) {
    const S m = x[i], n = y[i], a1 = 2 * m * n + S(kC1), a2 = 2 * (xy[i] - m * n) + S(kC2);
    const S b1 = m * m + n * n + S(kC1), b2 = xx[i] - m * m + yy[i] - n * n + S(kC2), over = 1 / (b1 * b2);
    const S s = a1 * a2 * over;
    score[i] = s;
    x[i] = 2 * n * (a2 - a1) * over + 2 * m * s * (1 / b2 - 1 / b1);
    xx[i] = -s / b2;
    xy[i] = 2 * a1 * over;
  }
}

template <class S>
struct Work {
  Blur<S> blur;
  std::vector<S> image, truth, product;    // (height, width)
  std::vector<S> x, y, xx, yy, xy, score;  // (down, across)
  std::vector<S> by_x, by_xx, by_xy;       // (height, width)
};

template <class S>
MVS_INLINE void Products(const S* a, const S* b, int count, S* __restrict out) {
  for (int i = 0; i < count; ++i) out[i] = a[i] * b[i];
}

template <class S>
MVS_INLINE void Run(Work<S>* w) {
  const int area = w->blur.width * w->blur.height, windows = w->blur.across() * w->blur.down();
  Means(&w->blur, w->image.data(), w->x.data());
  Means(&w->blur, w->truth.data(), w->y.data());
  Products(w->image.data(), w->image.data(), area, w->product.data());
  Means(&w->blur, w->product.data(), w->xx.data());
  Products(w->truth.data(), w->truth.data(), area, w->product.data());
  Means(&w->blur, w->product.data(), w->yy.data());
  Products(w->image.data(), w->truth.data(), area, w->product.data());
  Means(&w->blur, w->product.data(), w->xy.data());
  Scores(windows, w->x.data(), w->y.data(), w->xx.data(), w->yy.data(), w->xy.data(), w->score.data());
  Spread(&w->blur, w->x.data(), w->by_x.data());
  Spread(&w->blur, w->xx.data(), w->by_xx.data());
  Spread(&w->blur, w->xy.data(), w->by_xy.data());
}

MVS_SIMD void RunOn(Work<float>* work) { Run(work); }
void RunOn(Work<double>* work) { Run(work); }

}  // namespace

template <class S>
double AddSsimGradient(const S* image, const S* truth, int width, const metrics::Box& box, S scale, S* by_image) {
  Work<S> w;
  w.blur.width = box.x1 - box.x0, w.blur.height = box.y1 - box.y0;
  if (w.blur.width < kSide || w.blur.height < kSide) return 0;
  const size_t area = static_cast<size_t>(w.blur.width) * w.blur.height;
  const size_t windows = static_cast<size_t>(w.blur.across()) * w.blur.down();
  w.blur.rows.resize(area);
  for (std::vector<S>* plane : {&w.image, &w.truth, &w.product, &w.by_x, &w.by_xx, &w.by_xy}) plane->resize(area);
  for (std::vector<S>* plane : {&w.x, &w.y, &w.xx, &w.yy, &w.xy, &w.score}) plane->resize(windows);
  for (int y = 0; y < w.blur.height; ++y) {
    const size_t at = static_cast<size_t>(box.y0 + y) * width + box.x0, to = static_cast<size_t>(y) * w.blur.width;
    std::copy_n(image + at, w.blur.width, w.image.begin() + static_cast<std::ptrdiff_t>(to));
    std::copy_n(truth + at, w.blur.width, w.truth.begin() + static_cast<std::ptrdiff_t>(to));
  }
  RunOn(&w);
  double sum = 0;
  for (const S score : w.score) sum += score;
  const S share = scale / S(windows);
  for (int y = 0; y < w.blur.height; ++y) {
    for (int x = 0; x < w.blur.width; ++x) {
      const size_t i = static_cast<size_t>(y) * w.blur.width + x;
      by_image[static_cast<size_t>(box.y0 + y) * width + box.x0 + x] +=
          share * (w.by_x[i] + 2 * w.image[i] * w.by_xx[i] + w.truth[i] * w.by_xy[i]);
    }
  }
  return sum / static_cast<double>(windows);
}

template double AddSsimGradient(const float*, const float*, int, const metrics::Box&, float, float*);
template double AddSsimGradient(const double*, const double*, int, const metrics::Box&, double, double*);

}  // namespace mvstudio::splats
