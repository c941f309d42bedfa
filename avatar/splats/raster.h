#pragma once

#include <vector>

#include "avatar/splats/tiles.h"

namespace mvstudio::splats {

/// Red, green, blue, premultiplied, and alpha: planes of height x width, rows from the top. Values in [0, 1], but colours can
/// be more where Gaussians are brighter than white.
template <class S>
struct RasterImage {
  int width = 0, height = 0;
  std::vector<S> values;  // (4, H, W)

  size_t area() const { return static_cast<size_t>(width) * height; }
  S* Plane(int channel) { return values.data() + static_cast<size_t>(channel) * area(); }
  const S* Plane(int channel) const { return values.data() + static_cast<size_t>(channel) * area(); }
};

/// Light that still gets through a pixel when it is full: what lies behind is left out.
inline constexpr double kFullPixel = 1e-4;

/// Blends the splats of each tile front to back on black. Colour C = sum of T alpha rgb, T = product of 1 - alpha before, alpha
/// = min(kMostAlpha, opacity exp(-d^T [a b; b c] d / 2)), or 0 below kLeastAlpha.
template <class S>
RasterImage<S> Rasterise(const std::vector<Splat<S>>& splats, const Tiles& tiles, int width, int height, int num_threads);

/// What the loss changes by each number of a splat.
template <class S>
struct SplatGradient {
  S x = 0, y = 0, a = 0, b = 0, c = 0, opacity = 0;
  S rgb[3] = {0, 0, 0};
};

/// The gradients (as many as splats) from the loss's derivative by each value of the image (4, H, W). Sums run over the
/// tiles in order, so they do not depend on the number of threads.
template <class S>
std::vector<SplatGradient<S>> RasteriseBackward(const std::vector<Splat<S>>& splats, const Tiles& tiles,
                                                const RasterImage<S>& image, const RasterImage<S>& by_image, int num_threads);

extern template RasterImage<float> Rasterise(const std::vector<Splat<float>>&, const Tiles&, int, int, int);
extern template RasterImage<double> Rasterise(const std::vector<Splat<double>>&, const Tiles&, int, int, int);
extern template std::vector<SplatGradient<float>> RasteriseBackward(const std::vector<Splat<float>>&, const Tiles&,
                                                                    const RasterImage<float>&, const RasterImage<float>&, int);
extern template std::vector<SplatGradient<double>> RasteriseBackward(const std::vector<Splat<double>>&, const Tiles&,
                                                                     const RasterImage<double>&, const RasterImage<double>&,
                                                                     int);

}  // namespace mvstudio::splats
