#include <algorithm>
#include <limits>

#include "avatar/body/texture/texel_map.h"
#include "core/charts/chart_rows.h"

namespace mvstudio::body {
namespace {

/// A texel's known neighbours give its colour; false: it has none.
bool FillFromNeighbours(const std::vector<uint8_t>& known, int x, int y, Image* chart) {
  const int size = chart->width;
  int sum[3] = {0, 0, 0}, count = 0;
  for (int ny = std::max(0, y - 1); ny <= std::min(size - 1, y + 1); ++ny) {
    for (int nx = std::max(0, x - 1); nx <= std::min(size - 1, x + 1); ++nx) {
      if (!known[static_cast<size_t>(ny) * size + nx]) continue;
      for (int c = 0; c < 3; ++c) sum[c] += chart->Pixel(nx, ny)[c];
      ++count;
    }
  }
  for (int c = 0; c < 3 && count > 0; ++c) chart->Pixel(x, y)[c] = static_cast<uint8_t>((sum[c] + count / 2) / count);
  return count > 0;
}

/// Known texels of one chart grow by a ring at a time, at most `max_rings`.
void Grow(int max_rings, std::vector<uint8_t>* known, Image* chart) {
  const int size = chart->width;
  bool changed = true;
  for (int ring = 0; ring < max_rings && changed; ++ring) {
    changed = false;
    const std::vector<uint8_t> before = *known;
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        const size_t at = static_cast<size_t>(y) * size + x;
        if (before[at] || !FillFromNeighbours(before, x, y, chart)) continue;
        (*known)[at] = 1, changed = true;
      }
    }
  }
}

ChartRows RowsOf(const std::vector<uint8_t>& known, const std::array<Image, kNumParts>& textures) {
  std::vector<float> weights(known.begin(), known.end()), sums(3 * known.size());
  const size_t chart = known.size() / kNumParts;
  for (size_t t = 0; t < known.size(); ++t) {
    for (int c = 0; c < 3; ++c)
      sums[3 * t + c] = weights[t] * static_cast<float>(textures[t / chart].pixels[3 * (t % chart) + c]);
  }
  return MeanChartRows(textures[0].width, sums.data(), weights.data());
}

}  // namespace

void FillTexels(std::vector<uint8_t> known, std::array<Image, kNumParts>* textures) {
  const int size = (*textures)[0].width;
  const size_t chart = static_cast<size_t>(size) * size;
  const ChartRows rows = RowsOf(known, *textures);
  for (int part = 0; part < kNumParts; ++part) {
    Image& texture = (*textures)[part];
    std::vector<uint8_t> here(known.begin() + part * chart, known.begin() + (part + 1) * chart);
    Grow(std::max(1, size / 8), &here, &texture);
    for (size_t t = 0; t < chart; ++t) {
      const size_t row = part * size + t / size;
      if (here[t] || !rows.known[row]) continue;
      for (int c = 0; c < 3; ++c) texture.pixels[3 * t + c] = static_cast<uint8_t>(rows.colour[3 * row + c] + 0.5f);
      here[t] = 1;
    }
    Grow(std::numeric_limits<int>::max(), &here, &texture);
  }
}

}  // namespace mvstudio::body
