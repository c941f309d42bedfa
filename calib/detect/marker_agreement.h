// Private: markers of one board in one image.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/board/charuco_layout.h"

namespace mvstudio::calib {

/// Corners of one marker or tag, with where they lie on the board in squares from corner (0, 0).
struct Marker {
  Square square;     // charuco
  int first_id = 0;  // tags: id of corner 0
  Eigen::Matrix<double, 2, 4> px, on_board;
};

/// Drops markers that are not where their neighbours predict them (a wrong id, or a marker that is not on this board). Each is
/// compared with those around it, because no one homography holds over a large board behind a strong lens.
std::vector<Marker> AgreeingMarkers(const std::vector<Marker>& markers);

}  // namespace mvstudio::calib
