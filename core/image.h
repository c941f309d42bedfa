#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace mvstudio {

/// Owning 8-bit image, rows from the top, channels interleaved. Three channels are R, G, B; one is grey or a mask (0 or 255).
struct Image {
  int width = 0;
  int height = 0;
  int channels = 0;
  std::vector<uint8_t> pixels;  // (height, width, channels)

  Image() = default;
  Image(int width_, int height_, int channels_, uint8_t value = 0)
      : width(width_), height(height_), channels(channels_), pixels(static_cast<size_t>(width_) * height_ * channels_, value) {}

  bool empty() const { return pixels.empty(); }
  uint8_t* Pixel(int x, int y) { return pixels.data() + (static_cast<size_t>(y) * width + x) * channels; }
  const uint8_t* Pixel(int x, int y) const { return pixels.data() + (static_cast<size_t>(y) * width + x) * channels; }
};

}  // namespace mvstudio
