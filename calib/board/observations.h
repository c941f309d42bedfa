#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/board/board.h"
#include "calib/board/detection.h"
#include "geometry/rig/rig.h"

namespace mvstudio::calib {

/// A camera before it is calibrated.
struct CameraInput {
  std::string name;
  int width_px = 0, height_px = 0;
};

/// Boards, cameras and detected corners: the input of a calibration or of a check.
struct CalibrateInput {
  std::vector<Board> boards;  ///< rigid to each other when there are several
  std::vector<CameraInput> cameras;
  std::vector<Detection> detections;
  int num_corners_dropped = 0;              ///< corners that the detector found and then rejected; counts in rejected_fraction
  std::vector<int64_t> held_out_frames;     ///< kept out of the solution besides those of CalibrateOptions::holdout
  std::vector<std::vector<int>> same_lens;  ///< groups of cameras that are known to have one lens
  std::optional<geometry::Rig> start;       ///< a calibration to start from; its cameras keep their lens models
};

}  // namespace mvstudio::calib
