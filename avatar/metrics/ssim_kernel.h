#pragma once

#include <cstdint>

#include "avatar/metrics/ssim.h"

/// The arithmetic of avatar/metrics/ssim.h, one strip of columns at a time; used only by ssim.cc.
namespace mvstudio::metrics {

/// An image as read by the kernel: planes of doubles, or interleaved bytes when `planes` is null.
struct Samples {
  const double* planes = nullptr;
  const uint8_t* bytes = nullptr;
  int width = 0, height = 0, channels = 0;
  double range = 1;
  bool luma = false;  ///< one channel of BT.601 from three

  int NumPlanes() const { return luma ? 1 : channels; }
};

Samples SamplesOf(const PlanarImage& planar);
Samples SamplesOf(const Image& image);

/// Number of adjacent windows whose rows of moments fit into the first-level cache.
inline constexpr int kSsimStrip = 64;

/// For the windows that begin in the columns x0 <= x < x0 + count (count <= kSsimStrip) and all rows: out[y * stride + x - x0]
/// += weight * SSIM, for each plane; stride 0 sums each column. Images of one size, at least as large as the window.
void AddSsimStrip(const Samples& a, const Samples& b, SsimWindow window, int x0, int count, double weight, double* out,
                  int64_t stride);

}  // namespace mvstudio::metrics
