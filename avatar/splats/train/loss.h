#pragma once

#include "avatar/metrics/planar_image.h"
#include "avatar/splats/raster.h"
#include "core/image.h"

namespace mvstudio::splats {

/// What an image should show: the person on black behind its mask.
template <class S>
struct Truth {
  int width = 0, height = 0;
  std::vector<S> rgb;   // (3, H, W) in [0, 1]
  std::vector<S> mask;  // (H, W) 0 or 1
  metrics::Box box;     ///< around the mask, as `avatar eval` takes it: 5 % larger on each side, at least 11 px
};

/// From an image (H, W, 3) and a mask (H, W, 1), 255: person. Throws ContractViolation for other sizes.
template <class S>
Truth<S> TruthOf(const Image& image, const Image& mask);

struct LossWeights {
  double l1 = 1;
  double ssim = 0.5;
  double mask = 1;
};

/// Terms before their weights. l1 and mask are sums over the whole image, divided by the pixels of the box.
struct LossTerms {
  double l1 = 0;     ///< mean of the channels' absolute differences
  double ssim = 0;   ///< 1 - SSIM of the box: Wang et al., TIP 2004, windows inside it, mean over R, G, B; 0 without a window
  double mask = 0;   ///< squared differences of alpha and mask
  double total = 0;  ///< with the weights
};

/// The loss, and its derivative by each value of the image.
template <class S>
LossTerms Loss(const RasterImage<S>& image, const Truth<S>& truth, const LossWeights& weights, RasterImage<S>* by_image);

extern template Truth<float> TruthOf(const Image&, const Image&);
extern template Truth<double> TruthOf(const Image&, const Image&);
extern template LossTerms Loss(const RasterImage<float>&, const Truth<float>&, const LossWeights&, RasterImage<float>*);
extern template LossTerms Loss(const RasterImage<double>&, const Truth<double>&, const LossWeights&, RasterImage<double>*);

}  // namespace mvstudio::splats
