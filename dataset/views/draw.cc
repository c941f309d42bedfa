#include "dataset/views/draw.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace mvstudio::dataset {
namespace {

void Blend(const DrawColour& colour, double share, uint8_t* pixel) {
  const uint8_t wanted[] = {colour.r, colour.g, colour.b};
  for (int c = 0; c < 3; ++c) pixel[c] = static_cast<uint8_t>(std::lround(pixel[c] + share * (wanted[c] - pixel[c])));
}

/// Colours the pixels of a box by how far each is from a shape: `distance(centre)` is 0 on its middle.
template <class Distance>
void DrawNear(Eigen::Array2d low, Eigen::Array2d high, double reach, const DrawColour& colour, const Distance& distance,
              Image* rgb) {
  MVS_CHECK(rgb->channels == 3, "an image of " << rgb->channels << " channels is drawn on");
  if (!low.isFinite().all() || !high.isFinite().all()) return;
  const Eigen::Array2d size(rgb->width, rgb->height);
  low = (low - reach - 1).max(0.0).min(size), high = (high + reach + 1).max(-1.0).min(size - 1);
  for (int y = static_cast<int>(low.y()); y <= static_cast<int>(high.y()); ++y) {
    for (int x = static_cast<int>(low.x()); x <= static_cast<int>(high.x()); ++x) {
      const double share = std::clamp(reach + 0.5 - distance(Eigen::Vector2d(x, y)), 0.0, 1.0);
      if (share > 0) Blend(colour, share, rgb->Pixel(x, y));
    }
  }
}

}  // namespace

void DrawSegment(const Eigen::Vector2d& from_px, const Eigen::Vector2d& to_px, double width_px, const DrawColour& colour,
                 Image* rgb) {
  const Eigen::Vector2d along = to_px - from_px;
  const double squared = along.squaredNorm();
  const auto distance = [&](const Eigen::Vector2d& at) {
    const double t = squared > 0 ? std::clamp((at - from_px).dot(along) / squared, 0.0, 1.0) : 0;
    return (at - from_px - t * along).norm();
  };
  DrawNear(from_px.array().min(to_px.array()), from_px.array().max(to_px.array()), 0.5 * width_px, colour, distance, rgb);
}

void DrawDisc(const Eigen::Vector2d& centre_px, double radius_px, const DrawColour& colour, Image* rgb) {
  DrawSegment(centre_px, centre_px, 2 * radius_px, colour, rgb);
}

void DrawRing(const Eigen::Vector2d& centre_px, double radius_px, double width_px, const DrawColour& colour, Image* rgb) {
  const auto distance = [&](const Eigen::Vector2d& at) { return std::abs((at - centre_px).norm() - radius_px); };
  DrawNear(centre_px.array() - radius_px, centre_px.array() + radius_px, 0.5 * width_px, colour, distance, rgb);
}

void DrawMaskOutline(const Image& mask, const DrawColour& colour, Image* rgb) {
  MVS_CHECK(mask.width == rgb->width && mask.height == rgb->height && mask.channels == 1 && rgb->channels == 3,
            "a mask of " << mask.width << "x" << mask.height << " over an image of " << rgb->width << "x" << rgb->height);
  const auto inside = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < mask.width && y<mask.height&& * mask.Pixel(x, y)> 127;
  };
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      if (!inside(x, y)) continue;
      if (!inside(x - 1, y) || !inside(x + 1, y) || !inside(x, y - 1) || !inside(x, y + 1)) Blend(colour, 1, rgb->Pixel(x, y));
    }
  }
}

void PasteImage(const Image& part, int x, int y, Image* rgb) {
  MVS_CHECK(part.channels == 3 && rgb->channels == 3, "images of three channels");
  const int first = std::max(0, -x), end = std::min(part.width, rgb->width - x);
  for (int row = std::max(0, -y); row < std::min(part.height, rgb->height - y) && first < end; ++row)
    std::copy_n(part.Pixel(first, row), size_t{3} * static_cast<size_t>(end - first), rgb->Pixel(x + first, y + row));
}

}  // namespace mvstudio::dataset
