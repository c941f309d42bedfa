#include "avatar/run/render/backdrop.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "core/check.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::avatar {
namespace {

const std::map<std::string, std::array<uint8_t, 3>>& NamedColours() {
  static const std::map<std::string, std::array<uint8_t, 3>> colours = {{"black", {0, 0, 0}},
                                                                        {"white", {255, 255, 255}},
                                                                        {"grey", {128, 128, 128}},
                                                                        {"gray", {128, 128, 128}},
                                                                        {"green", {0, 177, 64}}};
  return colours;
}

/// #rgb, #rrggbb or r,g,b.
bool ParseColour(const std::string& text, std::array<uint8_t, 3>* colour) {
  unsigned v[3];
  int used = 0;
  const auto whole = [&](int count) { return count == 3 && used == static_cast<int>(text.size()); };
  int repeat = 1;
  if (text.size() == 7 && whole(std::sscanf(text.c_str(), "#%2x%2x%2x%n", v, v + 1, v + 2, &used)))
    repeat = 1;
  else if (text.size() == 4 && whole(std::sscanf(text.c_str(), "#%1x%1x%1x%n", v, v + 1, v + 2, &used)))
    repeat = 17;
  else if (!whole(std::sscanf(text.c_str(), "%3u,%3u,%3u%n", v, v + 1, v + 2, &used)))
    return false;
  for (int k = 0; k < 3; ++k) {
    if (v[k] * repeat > 255) return false;
    (*colour)[k] = static_cast<uint8_t>(v[k] * repeat);
  }
  return true;
}

/// Mean of bilinear samples over each pixel's footprint of an image that is scaled to cover the frame.
Image Cover(const Image& image, int width, int height) {
  Image out(width, height, 3);
  const double step = std::min(static_cast<double>(image.width) / width, static_cast<double>(image.height) / height);
  const int samples = std::clamp(static_cast<int>(std::ceil(step)), 1, 16);
  const double left = (image.width - step * width) / 2, top = (image.height - step * height) / 2;
  const auto sample = [&](double x, double y, double* sum) {
    const double cx = std::clamp(x - 0.5, 0.0, image.width - 1.0), cy = std::clamp(y - 0.5, 0.0, image.height - 1.0);
    const int x0 = static_cast<int>(cx), y0 = static_cast<int>(cy);
    const int x1 = std::min(x0 + 1, image.width - 1), y1 = std::min(y0 + 1, image.height - 1);
    const double fx = cx - x0, fy = cy - y0;
    for (int k = 0; k < 3; ++k) {
      sum[k] += (1 - fy) * ((1 - fx) * image.Pixel(x0, y0)[k] + fx * image.Pixel(x1, y0)[k]) +
                fy * ((1 - fx) * image.Pixel(x0, y1)[k] + fx * image.Pixel(x1, y1)[k]);
    }
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double sum[3] = {0, 0, 0};
      for (int s = 0; s < samples * samples; ++s)
        sample(left + step * (x + (s % samples + 0.5) / samples), top + step * (y + (s / samples + 0.5) / samples), sum);
      for (int k = 0; k < 3; ++k) out.Pixel(x, y)[k] = static_cast<uint8_t>(std::lround(sum[k] / (samples * samples)));
    }
  }
  return out;
}

/// Colours divided by opacity.
Image PlainColours(const Image& premultiplied) {
  Image out = premultiplied;
  for (size_t p = 0; p < out.pixels.size(); p += 4) {
    const int alpha = out.pixels[p + 3];
    for (size_t k = 0; k < 3 && alpha > 0; ++k)
      out.pixels[p + k] = static_cast<uint8_t>(std::min(255, (255 * out.pixels[p + k] + alpha / 2) / alpha));
  }
  return out;
}

}  // namespace

Backdrop::Backdrop(const std::string& text) {
  transparent_ = text.empty() || text == "none";
  if (transparent_) return;
  const auto named = NamedColours().find(text);
  if (named != NamedColours().end()) colour_ = named->second;
  if (named != NamedColours().end() || ParseColour(text, &colour_)) return;
  if (!std::filesystem::exists(text)) {
    throw UsageError("option 'background' '" + text +
                     "' is neither a file nor a colour; colours are black, white, grey, green, #rrggbb or r,g,b");
  }
  image_ = dataset::ReadImage(text);
}

const Image& Backdrop::Covering(int width, int height) const {
  Image& image = covering_[{width, height}];
  if (image.empty() && !image_.empty()) image = Cover(image_, width, height);
  return image;
}

Image Backdrop::Under(const Image& premultiplied) const {
  MVS_CHECK(premultiplied.channels == 4, premultiplied.channels << " channels");
  if (transparent_) return PlainColours(premultiplied);
  const Image& behind = Covering(premultiplied.width, premultiplied.height);
  Image out(premultiplied.width, premultiplied.height, 3);
  for (size_t p = 0; p < out.pixels.size() / 3; ++p) {
    const int clear = 255 - premultiplied.pixels[4 * p + 3];
    for (size_t k = 0; k < 3; ++k) {
      const int back = behind.empty() ? colour_[k] : behind.pixels[3 * p + k];
      out.pixels[3 * p + k] = static_cast<uint8_t>(std::min(255, premultiplied.pixels[4 * p + k] + (clear * back + 127) / 255));
    }
  }
  return out;
}

}  // namespace mvstudio::avatar
