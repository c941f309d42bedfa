#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace mvstudio::calib {

/// The corners of the board that one camera saw in one frame.
struct Detection {
  int camera_idx = 0;
  int64_t frame_idx = 0;        ///< frames with the same index were taken at the same time by all cameras
  std::vector<int> corner_ids;  ///< into CornersInBoard, distinct
  Eigen::Matrix2Xd points_px;   ///< (2, corner_ids.size())
  double sigma_px = 1;          ///< expected standard deviation per coordinate, relative to the other detections
  Eigen::VectorXd sigmas_px;    ///< (N) per corner, where known; empty: sigma_px for all
  int board_idx = 0;            ///< which of the boards, when several are in use

  int num_corners() const { return static_cast<int>(corner_ids.size()); }
};

}  // namespace mvstudio::calib
