#include "core/charts/chart_rows.h"

#include <array>
#include <cstddef>

#include "core/charts/body_charts.h"

namespace mvstudio {
namespace {

using RowSums = std::array<double, 4>;  // colour, weight

/// (24, S)
std::vector<RowSums> SumRows(int size, const float* colour_sums, const float* weights) {
  std::vector<RowSums> rows(static_cast<size_t>(kNumBodyCharts) * size, RowSums{});
  for (size_t row = 0; row < rows.size(); ++row) {
    for (size_t texel = row * size; texel < (row + 1) * size; ++texel) {
      for (int c = 0; c < 3; ++c) rows[row][c] += colour_sums[3 * texel + c];
      rows[row][3] += weights[texel];
    }
  }
  return rows;
}

/// (24, 24) similarity of the rows of two charts; largest for a chart itself.
std::array<std::array<double, kNumBodyCharts>, kNumBodyCharts> Likeness() {
  constexpr double kAlikeShare = 0.1;
  std::array<std::array<double, kNumBodyCharts>, kNumBodyCharts> likeness{};
  for (int chart = 0; chart < kNumBodyCharts; ++chart) likeness[chart][chart] = 1;
  for (const auto& group : kAlikeCharts) {
    for (const int a : group) {
      for (const int b : group) {
        if (a != b) likeness[a - 1][b - 1] = kAlikeShare;
      }
    }
  }
  return likeness;
}

}  // namespace

ChartRows MeanChartRows(int size, const float* colour_sums, const float* weights) {
  const std::vector<RowSums> rows = SumRows(size, colour_sums, weights);
  const auto likeness = Likeness();
  ChartRows out{std::vector<float>(3 * rows.size()), std::vector<uint8_t>(rows.size())};
  for (size_t at = 0; at < rows.size(); ++at) {
    RowSums sum{};
    for (size_t chart = 0; chart < kNumBodyCharts; ++chart) {
      for (int c = 0; c < 4; ++c) sum[c] += likeness[at / size][chart] * rows[chart * size + at % size][c];
    }
    out.known[at] = sum[3] > 0;
    for (int c = 0; c < 3 && sum[3] > 0; ++c) out.colour[3 * at + c] = static_cast<float>(sum[c] / sum[3]);
  }
  return out;
}

}  // namespace mvstudio
