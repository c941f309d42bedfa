#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "avatar/body/body_template.h"
#include "core/check.h"
#include "core/random.h"

namespace mvstudio::body {
namespace {

struct Rgb {
  double r, g, b;
};

Rgb operator*(const Rgb& c, double s) { return {c.r * s, c.g * s, c.b * s}; }
Rgb Mix(const Rgb& a, const Rgb& b, double t) { return {a.r + t * (b.r - a.r), a.g + t * (b.g - a.g), a.b + t * (b.b - a.b)}; }

Rgb FromHsv(double hue, double saturation, double value) {
  auto channel = [&](double n) {
    const double k = std::fmod(n + hue * 6, 6);
    return value - value * saturation * std::max(0.0, std::min({k, 4 - k, 1.0}));
  };
  return {255 * channel(5), 255 * channel(3), 255 * channel(1)};
}

double Hash(uint64_t seed, int64_t x, int64_t y) {
  return Rng(seed * 0x9e3779b97f4a7c15ull ^ (static_cast<uint64_t>(x) << 32) ^ static_cast<uint64_t>(y & 0xffffffff)).Uniform();
}

/// Value noise with `cells` cells along the chart, in [0, 1].
double Noise(uint64_t seed, double u, double v, int cells) {
  const double x = u * cells, y = v * cells;
  const int64_t ix = static_cast<int64_t>(std::floor(x)), iy = static_cast<int64_t>(std::floor(y));
  auto smooth = [](double t) { return t * t * (3 - 2 * t); };
  const double fx = smooth(x - ix), fy = smooth(y - iy);
  const double top = Hash(seed, ix, iy) * (1 - fx) + Hash(seed, ix + 1, iy) * fx;
  const double bottom = Hash(seed, ix, iy + 1) * (1 - fx) + Hash(seed, ix + 1, iy + 1) * fx;
  return top * (1 - fy) + bottom * fy;
}

/// 5 x 7 glyphs, one row of five bits each from the top.
constexpr uint8_t kGlyphs[][7] = {{14, 17, 17, 31, 17, 17, 17}, {30, 17, 30, 17, 17, 17, 30}, {31, 16, 30, 16, 16, 16, 31},
                                  {17, 18, 20, 24, 20, 18, 17}, {17, 27, 21, 17, 17, 17, 17}, {30, 17, 17, 30, 20, 18, 17},
                                  {31, 4, 4, 4, 4, 4, 4},       {14, 1, 6, 1, 17, 17, 14},    {6, 10, 18, 31, 2, 2, 2}};

/// 1 on the strokes of glyphs laid out in `rows` rows.
bool Glyph(uint64_t seed, double u, double v, int rows) {
  const double x = u * rows * 8.0 * 0.9, y = (1 - v) * rows * 10.0;
  const int64_t cell_x = static_cast<int64_t>(x / 7), cell_y = static_cast<int64_t>(y / 10);
  const int column = static_cast<int>(x - 7.0 * cell_x) - 1, row = static_cast<int>(y - 10.0 * cell_y) - 1;
  if (column < 0 || column > 4 || row < 0 || row > 6) return false;
  const int glyph = static_cast<int>(Hash(seed, cell_x, cell_y) * std::size(kGlyphs));
  return (kGlyphs[glyph][row] >> (4 - column)) & 1;
}

enum class Style { kChecks, kStripes, kGlyphs, kDiamonds, kSkin, kHead, kShoe };

struct Cloth {
  Style style;
  double hue, saturation, value;
  int count;  // repeats along the chart
};

/// Clothing of parts 1..24: patterned shirt with lettering, checked trousers, plain skin, hair.
constexpr Cloth kCloths[kNumParts] = {
    {Style::kGlyphs, 0.58, 0.65, 0.80, 7},   {Style::kGlyphs, 0.02, 0.60, 0.85, 7},   {Style::kSkin, 0.06, 0.42, 0.80, 6},
    {Style::kSkin, 0.08, 0.42, 0.86, 6},     {Style::kShoe, 0.95, 0.60, 0.60, 6},     {Style::kShoe, 0.45, 0.60, 0.55, 6},
    {Style::kChecks, 0.72, 0.45, 0.72, 9},   {Style::kChecks, 0.52, 0.45, 0.70, 9},   {Style::kStripes, 0.78, 0.40, 0.78, 12},
    {Style::kStripes, 0.48, 0.45, 0.76, 12}, {Style::kDiamonds, 0.68, 0.50, 0.66, 9}, {Style::kDiamonds, 0.55, 0.50, 0.62, 9},
    {Style::kChecks, 0.83, 0.35, 0.72, 8},   {Style::kChecks, 0.42, 0.38, 0.70, 8},   {Style::kStripes, 0.12, 0.70, 0.90, 9},
    {Style::kStripes, 0.30, 0.55, 0.75, 9},  {Style::kDiamonds, 0.10, 0.70, 0.92, 7}, {Style::kDiamonds, 0.34, 0.55, 0.78, 7},
    {Style::kSkin, 0.05, 0.40, 0.84, 8},     {Style::kSkin, 0.07, 0.44, 0.82, 8},     {Style::kChecks, 0.15, 0.55, 0.88, 8},
    {Style::kChecks, 0.27, 0.55, 0.80, 8},   {Style::kHead, 0.055, 0.42, 0.85, 8},    {Style::kHead, 0.065, 0.42, 0.85, 8}};

double Pattern(const Cloth& cloth, uint64_t seed, double u, double v) {
  const double n = cloth.count;
  auto parity = [](double x) { return static_cast<int64_t>(std::floor(x)) & 1; };
  switch (cloth.style) {
    case Style::kChecks:
      return (parity(u * n) ^ parity(v * n)) ? 0.62 : 1.0;
    case Style::kStripes:
      return parity(v * n) ? 0.58 : (parity(u * n * 2) ? 0.92 : 1.0);
    case Style::kGlyphs:
      return Glyph(seed, u, v, cloth.count) ? 0.30 : 1.0;
    case Style::kDiamonds:
      return (parity((u + v) * n) ^ parity((u - v) * n + 64)) ? 0.66 : 1.0;
    case Style::kShoe:
      return v > 0.5 ? 1.0 : (parity(u * n * 2) ? 0.7 : 1.0);
    case Style::kSkin:
    case Style::kHead:
      return 1.0;
  }
  return 1.0;
}

/// Hair, eyes and mouth. u runs around the head, v from the neck to the crown.
Rgb HeadColor(const Rgb& skin, uint64_t seed, double u, double v, bool left) {
  const double from_front = (left ? u : 1 - u) - 0.046;  // 0 at the nose, 0.45 at the ear, 0.91 at the back of the head
  auto ramp = [&](double low, double high) { return std::clamp((from_front - low) / (high - low), 0.0, 1.0); };
  const double hair_line = 0.71 - 0.15 * ramp(0.18, 0.38) - 0.34 * ramp(0.46, 0.64);
  if (v > hair_line + 0.02 * Noise(seed, u, v, 30)) return Mix({60, 38, 22}, {110, 70, 36}, Noise(seed, u * 6, v, 14));
  auto spot = [&](double cu, double cv, double ru, double rv) { return std::hypot((from_front - cu) / ru, (v - cv) / rv) < 1; };
  if (spot(0.085, 0.568, 0.016, 0.017)) return {40, 40, 60};
  if (spot(0.085, 0.568, 0.038, 0.022)) return {235, 235, 235};
  if (spot(0.090, 0.625, 0.050, 0.011)) return {80, 52, 34};
  if (spot(0.0, 0.355, 0.065, 0.014)) return {170, 70, 70};
  return skin;
}

Rgb ChartColor(int part, uint64_t seed, double u, double v) {
  const Cloth& cloth = kCloths[part - 1];
  Rgb color = FromHsv(cloth.hue, cloth.saturation, cloth.value);
  if (cloth.style == Style::kHead) color = HeadColor(color, seed, u, v, part == 24);
  const double weave = 0.10 * (Noise(seed + 1, u, v, 96) - 0.5) + 0.10 * (Noise(seed + 2, u, v, 28) - 0.5) +
                       0.12 * (Noise(seed + 3, u, v, 6) - 0.5);
  const bool skin = cloth.style == Style::kSkin || cloth.style == Style::kHead;
  return color * (Pattern(cloth, seed, u, v) * (1 + (skin ? 0.8 : 1.3) * weave));
}

}  // namespace

std::array<Image, kNumParts> MannequinTextures(int size_px, uint64_t seed) {
  MVS_CHECK(size_px >= 2, "size_px = " << size_px);
  constexpr int kSuper = 2;
  std::array<Image, kNumParts> charts;
  for (int part = 1; part <= kNumParts; ++part) {
    Image chart(size_px, size_px, 3);
    for (int y = 0; y < size_px; ++y) {
      for (int x = 0; x < size_px; ++x) {
        Rgb sum{0, 0, 0};
        for (int s = 0; s < kSuper * kSuper; ++s) {
          const double u = (x + (s % kSuper + 0.5) / kSuper) / size_px, v = (y + (s / kSuper + 0.5) / kSuper) / size_px;
          const Rgb c = ChartColor(part, seed * 64 + part, u, v);
          sum = {sum.r + c.r, sum.g + c.g, sum.b + c.b};
        }
        const double scale = 1.0 / (kSuper * kSuper);
        uint8_t* pixel = chart.Pixel(x, y);
        const double rgb[3] = {sum.r * scale, sum.g * scale, sum.b * scale};
        for (int k = 0; k < 3; ++k) pixel[k] = static_cast<uint8_t>(std::lround(std::clamp(rgb[k], 0.0, 255.0)));
      }
    }
    charts[part - 1] = std::move(chart);
  }
  return charts;
}

}  // namespace mvstudio::body
