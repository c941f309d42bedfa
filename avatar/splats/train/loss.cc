#include "avatar/splats/train/loss.h"

#include <cmath>

#include "avatar/metrics/masks.h"
#include "avatar/splats/train/ssim_gradient.h"
#include "core/check.h"

namespace mvstudio::splats {

template <class S>
Truth<S> TruthOf(const Image& image, const Image& mask) {
  MVS_CHECK(image.channels == 3 && mask.channels == 1, image.channels << " and " << mask.channels << " channels");
  MVS_CHECK(image.width == mask.width && image.height == mask.height, "an image and a mask of different sizes");
  constexpr int kLeastBox = 11;
  Truth<S> truth;
  truth.width = image.width, truth.height = image.height;
  const size_t area = mask.pixels.size();
  truth.rgb.assign(3 * area, S(0)), truth.mask.assign(area, S(0));
  metrics::Mask inside(area);
  for (size_t i = 0; i < area; ++i) {
    inside[i] = mask.pixels[i] >= 128;
    if (!inside[i]) continue;
    truth.mask[i] = S(1);
    for (size_t c = 0; c < 3; ++c) truth.rgb[c * area + i] = S(image.pixels[3 * i + c]) / 255;
  }
  truth.box = metrics::MaskBox(inside, image.width, image.height, 0.05, kLeastBox);
  return truth;
}

template <class S>
LossTerms Loss(const RasterImage<S>& image, const Truth<S>& truth, const LossWeights& weights, RasterImage<S>* by_image) {
  MVS_CHECK(image.width == truth.width && image.height == truth.height, "a picture and a truth of different sizes");
  const size_t area = image.area();
  const double box = std::max(1, (truth.box.x1 - truth.box.x0) * (truth.box.y1 - truth.box.y0));
  by_image->width = image.width, by_image->height = image.height;
  by_image->values.assign(4 * area, S(0));
  LossTerms terms;
  const S l1_slope = S(weights.l1 / (3 * box)), mask_slope = S(2 * weights.mask / box);
  for (size_t i = 0; i < 3 * area; ++i) {
    const S difference = image.values[i] - truth.rgb[i];
    terms.l1 += std::abs(difference);
    by_image->values[i] = difference > 0 ? l1_slope : difference < 0 ? -l1_slope : S(0);
  }
  for (size_t i = 0; i < area; ++i) {
    const S difference = image.Plane(3)[i] - truth.mask[i];
    terms.mask += difference * difference;
    by_image->Plane(3)[i] = mask_slope * difference;
  }
  terms.l1 /= 3 * box, terms.mask /= box;
  double ssim = 0;
  for (int c = 0; c < 3; ++c)
    ssim += AddSsimGradient(image.Plane(c), truth.rgb.data() + static_cast<size_t>(c) * area, image.width, truth.box,
                            S(-weights.ssim / 3), by_image->Plane(c)) /
            3;
  const bool windows = truth.box.x1 - truth.box.x0 >= 11 && truth.box.y1 - truth.box.y0 >= 11;
  terms.ssim = windows ? 1 - ssim : 0;
  terms.total = weights.l1 * terms.l1 + weights.ssim * terms.ssim + weights.mask * terms.mask;
  return terms;
}

template Truth<float> TruthOf(const Image&, const Image&);
template Truth<double> TruthOf(const Image&, const Image&);
template LossTerms Loss(const RasterImage<float>&, const Truth<float>&, const LossWeights&, RasterImage<float>*);
template LossTerms Loss(const RasterImage<double>&, const Truth<double>&, const LossWeights&, RasterImage<double>*);

}  // namespace mvstudio::splats
