#pragma once

namespace mvstudio::calib {

/// Board corners triangulated from all cameras that see them, against the board.
struct BoardMetrics {
  double edge_rms_mm = 0, edge_median_mm = 0, edge_bias_mm = 0;
  double pair_rms_mm = 0, pair_bias_mm = 0;
  double reprojection_rms_px = 0, reprojection_median_px = 0;
};

}  // namespace mvstudio::calib
