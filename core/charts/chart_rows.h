#pragma once

#include <cstdint>
#include <vector>

namespace mvstudio {

/// Mean colours of the rows of all charts.
struct ChartRows {
  std::vector<float> colour;   ///< (24, S, 3)
  std::vector<uint8_t> known;  ///< (24, S) 0: no texel of the row has a weight, in the chart itself or in those alike
};

/// The back of trousers is coloured like their front: weighted means over a row of a chart and, for a tenth, the same row of
/// the charts alike (kAlikeCharts). `colour_sums` (24, S, S, 3): weight * colour; `weights` (24, S, S).
ChartRows MeanChartRows(int size, const float* colour_sums, const float* weights);

}  // namespace mvstudio
