#pragma once

#include <cstdint>
#include <vector>

#include "core/image.h"

/// Scores between images, in float64, as defined in docs/metrics.md. Depends only on core/.
namespace mvstudio::metrics {

/// An image to be scored: planes one after the other, (channels, height, width), samples in [0, range].
struct PlanarImage {
  int width = 0, height = 0, channels = 0;
  double range = 1;  ///< L of SSIM and the peak of PSNR: 1, 255, 65535, …
  std::vector<double> samples;

  size_t PlaneSize() const { return static_cast<size_t>(width) * static_cast<size_t>(height); }
  const double* Plane(int channel) const { return samples.data() + PlaneSize() * static_cast<size_t>(channel); }
};

/// 8 bits, range 255.
PlanarImage FromImage(const Image& image);

/// Y = 0.299 R + 0.587 G + 0.114 B (BT.601) of three channels; one channel is unchanged. Throws ContractViolation for
/// others.
PlanarImage Luma(const PlanarImage& planar);

/// Why a score has a value or none.
enum class Status {
  kOk,
  kSizesDiffer,   ///< the two images differ in size, channels or range
  kTooSmall,      ///< smaller than the window in one direction, or without a pixel
  kNotFinite,     ///< NaN or infinity in an image, or a range that is infinite or has no inverse
  kOutsideRange,  ///< a sample is below 0 or above the range by more than 1e-6 of it
  kNothingLeft,   ///< the region or mask holds no pixel
};
const char* ToString(Status status);

/// Reason against a comparison; kOk when there is none. `least`: smallest width and height.
Status Check(const PlanarImage& a, const PlanarImage& b, int least = 1);
Status Check(const Image& a, const Image& b, int least = 1);

/// Pixels x0 <= x < x1, y0 <= y < y1.
struct Box {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// Pixels that count, row by row; nonzero: yes.
using Mask = std::vector<uint8_t>;

}  // namespace mvstudio::metrics
