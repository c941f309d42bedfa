#pragma once

#include <Eigen/Core>
#include <map>
#include <utility>
#include <vector>

#include "calib/board/board.h"
#include "calib/bundle/view.h"
#include "triangulate/point/prepared_rig.h"
#include "triangulate/point/types.h"

namespace mvstudio::calib {

/// Board corners triangulated from all cameras that see them, compared with the board. NaN where nothing could be
/// measured.
struct BoardMetrics {
  double edge_rms_mm = 0, edge_median_mm = 0,
         edge_bias_mm = 0;  ///< of neighbouring corners, strays among them; median of |error|, bias: mean error
  double pair_rms_mm = 0, pair_bias_mm = 0;  ///< of all pairs of corners of a board in a frame, strays left out
  double reprojection_rms_px = 0, reprojection_median_px = 0;  ///< 2-D, of the triangulated points in all their images
  int num_frames = 0, num_points = 0, num_edges = 0;
  int num_stray_points = 0;  ///< of num_points; left out of pairs, see ComputeBoardMetrics
};

/// Triangulates every corner that two or more cameras see in a frame, by least squares of the pixel errors with the
/// cameras fixed as in `state`. Board poses and weights are not used. No observation is rejected; left out are corners without
/// a ray, without parallax, or without a point in front of their cameras. A corner whose distances are off (median) by more
/// than 8 times those of the other corners of its board in that frame, and of all corners, is a stray: counted, and not in
/// the pairs. So one wrong detection says nothing of the lengths, and a camera that moved, which displaces all corners of
/// a board, says all it did.
///
/// Distances are measured minus true (positive bias: too long). Neighbours: along rows and columns of a grid; the sides of
/// a tag; of single points, those that are each other's nearest. `views` decide which frames take part. With time offsets,
/// each camera's corners are moved back to the time of the frame by the board's motion (BoardMotion), which comes from
/// other frames. After caliscope, "scale accuracy".
BoardMetrics ComputeBoardMetrics(const std::vector<Board>& boards, const std::vector<View>& views, const RigState& state);

using CornerObservations = std::map<int, std::vector<triangulate::Observation>>;  ///< of one board at one time step, by corner
using CornerCloud = std::map<int, Eigen::Vector3d>;                               ///< in world, metres, by corner

/// Maximum-likelihood position of every corner that two or more cameras have a ray to; all rays are used. Left out: rays
/// that span less than `min_parallax_rad`, or that do not meet in front of their cameras. `errors_px`, when given,
/// receives the length of each observation's residual.
CornerCloud TriangulateCorners(const triangulate::PreparedRig& rig, const CornerObservations& observations,
                               double min_parallax_rad = 0, std::vector<double>* errors_px = nullptr);

/// Pairs of neighbouring corners (see ComputeBoardMetrics), each once, the smaller id first.
std::vector<std::pair<int, int>> NeighbouringCorners(const Board& board);

}  // namespace mvstudio::calib
