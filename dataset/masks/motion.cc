#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "dataset/masks/limbs.h"
#include "dataset/masks/patch.h"

namespace mvstudio::dataset {
namespace {

constexpr int kSameColour = 14;  ///< grey levels of a channel within which two colours are one surface in one light

bool Same(const uint8_t* a, const uint8_t* b) {
  return std::abs(a[0] - b[0]) <= kSameColour && std::abs(a[1] - b[1]) <= kSameColour && std::abs(a[2] - b[2]) <= kSameColour;
}

/// The colour that most of the frames agree with at a pixel; `share` receives how many.
const uint8_t* MostFrequent(const std::vector<Image>& frames, size_t i, double* share) {
  const uint8_t* best = nullptr;
  int most = 0;
  for (const Image& candidate : frames) {
    int votes = 0;
    for (const Image& other : frames) votes += Same(&candidate.pixels[3 * i], &other.pixels[3 * i]);
    if (votes > most) most = votes, best = &candidate.pixels[3 * i];
    if (2 * votes > int(frames.size())) break;
  }
  *share = most / double(frames.size());
  return best;
}

Image MostFrequentColours(const std::vector<Image>& frames) {
  Image background(frames[0].width, frames[0].height, 3);
  double share = 0;
  for (size_t i = 0; i < size_t(background.width) * background.height; ++i)
    std::copy_n(MostFrequent(frames, i, &share), 3, &background.pixels[3 * i]);
  return background;
}

/// 255 where a frame shows another surface than the background; single pixels and pinholes are noise.
Image Moving(const Image& frame, const Image& background) {
  const internal::PixelBox nobody;
  BackgroundModel model{background, {}, std::vector<uint8_t>(size_t(frame.width) * frame.height, 1)};
  const cv::Scalar gain = internal::ExposureGain(frame, nobody, model);
  Image moving(frame.width, frame.height, 1, 0);
  for (size_t i = 0; i < moving.pixels.size(); ++i) {
    double most = 0, now2 = 0, both = 0, then2 = 0;
    for (int k = 0; k < 3; ++k) {
      const double now = frame.pixels[3 * i + k], then = std::min(255.0, gain[k] * background.pixels[3 * i + k]);
      most = std::max(most, std::abs(now - then));
      now2 += now * now, then2 += then * then, both += now * then;
    }
    // A shadow has the background's hue: what is left after scaling is small.
    const double shade = both / std::max(then2, 1.0), left = std::sqrt(std::max(0.0, now2 - shade * both));
    const bool shadow = shade < 1 && shade > 0.6 && left < 0.7 * kSameColour;
    if (most > 1.6 * kSameColour && !shadow) moving.pixels[i] = 255;
  }
  cv::Mat view = internal::View(moving);
  cv::medianBlur(view, view, 3);
  return moving;
}

}  // namespace

MotionModel FindMotion(const std::vector<Image>& frames, const Image* plate, const MaskOptions&) {
  constexpr double kLeastMoving = 2e-4;
  MVS_CHECK(!frames.empty(), "motion needs frames");
  for (const Image& frame : frames) {
    MVS_CHECK(frame.channels == 3 && frame.width == frames[0].width && frame.height == frames[0].height, "sizes differ");
  }
  MVS_CHECK(!plate || (plate->channels == 3 && plate->width == frames[0].width && plate->height == frames[0].height),
            "the clean plate has another size than the frames");
  const Image background = plate ? *plate : MostFrequentColours(frames);
  MotionModel motion;
  double count = 0;
  for (const Image& frame : frames) {
    motion.moving.push_back(Moving(frame, background));
    for (const uint8_t v : motion.moving.back().pixels) count += v != 0;
  }
  motion.moving_fraction = count / (double(frames.size()) * frames[0].width * frames[0].height);
  if (motion.moving_fraction < kLeastMoving) motion.status = Status::kDegenerate;
  return motion;
}

}  // namespace mvstudio::dataset
