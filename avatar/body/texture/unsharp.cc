#include "avatar/body/texture/unsharp.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/check.h"

namespace mvstudio::body {
namespace {

/// Half of a Gaussian: its middle first.
std::vector<double> HalfGaussian(int longer_edge_px) {
  constexpr double kSigma = 2.9, kReach = 8, kOfPx = 1024;
  const double scale = longer_edge_px / kOfPx;
  std::vector<double> half;
  for (int i = 0; i <= std::max(1, static_cast<int>(std::ceil(kReach * scale))); ++i)
    half.push_back(std::exp(-0.5 * std::pow(i / (kSigma * scale), 2)));
  return half;
}

/// Convolves four numbers a pixel, one after the other in memory, along rows or columns; zero outside.
std::vector<double> Blurred(const std::vector<double>& in, int width, int height, bool along_rows,
                            const std::vector<double>& half) {
  std::vector<double> out(in.size(), 0);
  const int reach = static_cast<int>(half.size()) - 1;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double* to = out.data() + 4 * (static_cast<size_t>(y) * width + x);
      for (int i = -reach; i <= reach; ++i) {
        const int sx = along_rows ? x + i : x, sy = along_rows ? y : y + i;
        if (sx < 0 || sy < 0 || sx >= width || sy >= height) continue;
        const double* from = in.data() + 4 * (static_cast<size_t>(sy) * width + sx);
        for (int c = 0; c < 4; ++c) to[c] += half[static_cast<size_t>(std::abs(i))] * from[c];
      }
    }
  }
  return out;
}

}  // namespace

Image SharpenInMask(const Image& image, const Image& mask, double amount) {
  MVS_CHECK(image.channels == 3 && mask.channels == 1 && mask.width == image.width && mask.height == image.height,
            "an image and its mask");
  MVS_CHECK(amount >= 0 && amount <= 100, "amount " << amount);
  if (amount == 0 || image.empty()) return image;
  std::vector<double> sums(4 * mask.pixels.size(), 0);  // colour and weight
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    if (mask.pixels[i] < 128) continue;
    for (size_t c = 0; c < 3; ++c) sums[4 * i + c] = image.pixels[3 * i + c];
    sums[4 * i + 3] = 1;
  }
  const std::vector<double> half = HalfGaussian(std::max(image.width, image.height));
  for (const bool along_rows : {true, false}) sums = Blurred(sums, image.width, image.height, along_rows, half);
  Image out = image;
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    if (mask.pixels[i] < 128) continue;
    for (size_t c = 0; c < 3; ++c) {
      const double value = image.pixels[3 * i + c], blurred = sums[4 * i + c] / sums[4 * i + 3];
      out.pixels[3 * i + c] = static_cast<uint8_t>(std::lround(std::clamp(value + amount * (value - blurred), 0.0, 255.0)));
    }
  }
  return out;
}

}  // namespace mvstudio::body
