#pragma once

#include <limits>
#include <vector>

#include "avatar/metrics/planar_image.h"

namespace mvstudio::metrics {

/// The two conventions in use. K1 = 0.01, K2 = 0.03 and L = the images' range in both; the mean is over the windows
/// inside the image, and over channels.
enum class SsimWindow {
  kWang2004,  ///< Gaussian 11x11, sigma 1.5, population covariance: Wang et al., "Image quality assessment: from error
              ///< visibility to structural similarity", TIP 2004
  kUniform7,  ///< uniform 7x7, sample covariance (n - 1): the default of scikit-image, which many avatar papers quote
};

/// Side of the window, px.
int SsimWindowSize(SsimWindow window);

/// SSIM of every window, mean over channels. Element (y, x) belongs to the window centred at pixel (y + border, x +
/// border).
struct SsimMap {
  Status status = Status::kOk;
  int width = 0, height = 0, border = 0;
  std::vector<double> values;  ///< (height, width), each in [-1, 1]; empty unless kOk
};
SsimMap ComputeSsimMap(const PlanarImage& a, const PlanarImage& b, SsimWindow window = SsimWindow::kWang2004,
                       int num_threads = 1);

/// A score, or the reason for its absence.
struct Score {
  Status status = Status::kOk;
  double value = std::numeric_limits<double>::quiet_NaN();  ///< NaN unless kOk
};

/// Mean of the map: the SSIM of the whole image.
Score Mean(const SsimMap& map);
/// Mean over the windows inside the box: the SSIM of that crop.
Score Mean(const SsimMap& map, const Box& box);
/// Mean over the windows centred in the mask (of the image's size).
Score Mean(const SsimMap& map, const Mask& mask);

/// Mean(ComputeSsimMap(…)) to rounding, without the memory of a map.
Score Ssim(const PlanarImage& a, const PlanarImage& b, SsimWindow window = SsimWindow::kWang2004, int num_threads = 1);
/// Of 8-bit images, range 255, without a copy in float64.
Score Ssim(const Image& a, const Image& b, SsimWindow window = SsimWindow::kWang2004, int num_threads = 1);

/// Ssim(Luma(a), Luma(b), …) without the copies.
Score SsimOfLuma(const PlanarImage& a, const PlanarImage& b, SsimWindow window = SsimWindow::kWang2004, int num_threads = 1);
Score SsimOfLuma(const Image& a, const Image& b, SsimWindow window = SsimWindow::kWang2004, int num_threads = 1);

}  // namespace mvstudio::metrics
