#include "dataset/masks/patch.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/statistics.h"
#include "dataset/masks/limbs.h"

namespace mvstudio::dataset::internal {

cv::Mat View(const Image& image) {
  return cv::Mat(image.height, image.width, CV_8UC(image.channels), const_cast<uint8_t*>(image.pixels.data()));
}

Image Dilated(const Image& mask, int radius_px) {
  Image out(mask.width, mask.height, 1, 0);
  const cv::Mat from = View(mask);
  if (cv::countNonZero(from) == 0) return out;
  cv::Mat distance;
  cv::distanceTransform(from == 0, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  View(out).setTo(255, distance <= radius_px + 0.5);
  return out;
}

cv::Scalar ExposureGain(const Image& rgb, const PixelBox& people, const BackgroundModel& model) {
  std::array<std::vector<float>, 3> ratios;
  const int step = std::max(1, std::max(rgb.width, rgb.height) / 160);
  for (int y = step / 2; y < rgb.height; y += step) {
    for (int x = step / 2; x < rgb.width; x += step) {
      if (x >= people.x0 && x < people.x1 && y >= people.y0 && y < people.y1) continue;
      if (!model.known[size_t(y) * rgb.width + x]) continue;
      const uint8_t *now = rgb.Pixel(x, y), *then = model.colour.Pixel(x, y);
      for (int k = 0; k < 3; ++k) {
        if (then[k] > 30 && then[k] < 235 && now[k] < 250) ratios[k].push_back(float(now[k]) / float(then[k]));
      }
    }
  }
  cv::Scalar gain(1, 1, 1);
  for (int k = 0; k < 3; ++k) {
    auto& r = ratios[k];
    if (r.size() < 50) continue;
    gain[k] = std::clamp(double(UpperMedian(r.begin(), r.end())), 0.7, 1.4);
  }
  return gain;
}

Patch MakePatch(const Image& rgb, const PixelBox& box, const BackgroundModel& model, const cv::Scalar& gain) {
  const cv::Rect rect(box.x0, box.y0, box.width(), box.height());
  Patch patch;
  patch.offset = {double(box.x0), double(box.y0)};
  View(rgb)(rect).convertTo(patch.rgb, CV_32F);
  View(model.colour)(rect).convertTo(patch.background, CV_32F);
  cv::multiply(patch.background, gain, patch.background);
  patch.sigma = cv::Mat(rgb.height, rgb.width, CV_32F, const_cast<float*>(model.sigma.data()))(rect).clone();
  cv::Mat(rgb.height, rgb.width, CV_8U, const_cast<uint8_t*>(model.known.data()))(rect).convertTo(patch.known, CV_32F);
  return patch;
}

Patch Reduced(const Patch& full, int longer_side_px) {
  const double factor = std::max(full.width(), full.height()) / double(longer_side_px);
  if (factor <= 1.25) return full;
  const cv::Size size(std::max(1, int(std::lround(full.width() / factor))),
                      std::max(1, int(std::lround(full.height() / factor))));
  Patch patch;
  patch.scale = double(full.width()) / size.width;
  patch.offset = full.offset + Eigen::Vector2d::Constant(0.5 * (patch.scale - 1));
  const auto shrink = [&](const cv::Mat& from, cv::Mat* to) { cv::resize(from, *to, size, 0, 0, cv::INTER_AREA); };
  shrink(full.rgb, &patch.rgb), shrink(full.background, &patch.background);
  shrink(full.sigma, &patch.sigma), shrink(full.known, &patch.known);
  if (!full.hint.empty()) shrink(full.hint, &patch.hint);
  return patch;
}

}  // namespace mvstudio::dataset::internal
