#pragma once

#include <cstdint>
#include <vector>

#include "core/progress.h"
#include "triangulate/point/point.h"

namespace mvstudio::triangulate {

/// Detections of many points as a structure of arrays: entry [camera * num_points + point]. NaN in x_px or y_px where a
/// camera does not see the point.
struct PointBatch {
  int num_cameras = 0;     ///< of the rig, in its order
  int64_t num_points = 0;  ///< e.g. joints of all persons in all frames
  std::vector<double> x_px, y_px;
  std::vector<double> sigma_px;  ///< standard deviation of each coordinate; read only where the point is seen
};

/// A batch of this size without detections, with sigmas of 1 px.
PointBatch MakeBatch(int num_cameras, int64_t num_points);

struct BatchOptions {
  PointOptions point;             ///< seed: point i has seed + first_point + i
  int gauss_newton_steps = 0;     ///< kRobust, kAllViews: this many steps from the linear start (1 … 8); 0: to convergence
  bool single_precision = false;  ///< solve in float, about a centred origin; re-solve in double where the accuracy check
                                  ///< fails
  int64_t first_point = 0;        ///< index of the batch's first point in a take that is solved piece by piece
};

/// Points as a structure of arrays. As in Point, values are valid only where the status is kOk; elsewhere they are NaN.
/// The covariance is that of the detections; the rig counts as exact.
struct BatchResult {
  int num_cameras = 0;
  int64_t num_points = 0;
  std::vector<uint8_t> status;     ///< static_cast<uint8_t>(Status)
  std::vector<double> x, y, z;     ///< m, in world
  std::vector<double> covariance;  ///< m^2, [k * num_points + point] with k = xx, xy, xz, yy, yz, zz
  std::vector<double> chi_squared, rms_px;
  std::vector<int32_t> num_views;  ///< used for the point
  std::vector<uint64_t> used;      ///< the views used: bit camera % 64 of [camera / 64 * num_points + point]

  Status StatusOf(int64_t point) const { return static_cast<Status>(status[point]); }
  bool Used(int camera, int64_t point) const { return used[camera / 64 * num_points + point] >> (camera % 64) & 1; }
};

/// TriangulatePoint for every point: the same statuses and views, values equal to rounding. Points whose views all agree
/// are solved several at a time in vector registers (linear least squares on the rays, then Gauss-Newton through the
/// lenses), and every check of TriangulatePoint is made on them. Any point that does not pass them all clearly goes to
/// TriangulatePoint. So do methods other than kRobust, kAllViews, kLinear and kMidpoint, and rigs with a wide-angle lens
/// model or with one camera under two names.
///
/// With `gauss_newton_steps` the iteration stops there if the next step would be below a tenth of a standard deviation.
/// The result of a point depends neither on the number of threads nor on the other points. Throws ContractViolation when
/// the arrays' sizes do not fit the rig, CancelledError when cancelled.
BatchResult TriangulateBatch(const PreparedRig& rig, const PointBatch& batch, const BatchOptions& options = {},
                             const RunContext& run = {});

}  // namespace mvstudio::triangulate
