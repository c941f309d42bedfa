#pragma once

namespace mvstudio::calib {

struct UncertaintySummary {
  double centre_px = 0, edge_px = 0, volume_mm = 0;
};

}  // namespace mvstudio::calib
