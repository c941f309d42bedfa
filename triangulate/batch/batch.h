#pragma once

#include <cstdint>
#include <vector>

#include "core/progress.h"
#include "triangulate/point/point.h"

namespace mvstudio::triangulate {

/// Detections of many points as structure of arrays: entry [camera * num_points + point]. A point that a camera does not see
/// has NaN in x_px or y_px there.
struct PointBatch {
  int num_cameras = 0;     ///< of the rig, in its order
  int64_t num_points = 0;  ///< e.g. joints of all persons in all frames
  std::vector<double> x_px, y_px;
  std::vector<double> sigma_px;  ///< standard deviation of each coordinate; read only where the point is seen
};

/// A batch of so many points that nobody sees, with sigmas of 1 px.
PointBatch MakeBatch(int num_cameras, int64_t num_points);

struct BatchOptions {
  PointOptions point;             ///< seed: point i has seed + first_point + i
  int gauss_newton_steps = 0;     ///< kRobust, kAllViews: so many steps from the linear start (1 … 8); 0: to convergence
  bool single_precision = false;  ///< the quick way in float, about a centred origin; what it cannot vouch for in double
  int64_t first_point = 0;        ///< where the batch stands in a take that is solved piece by piece
};

/// Points as structure of arrays. As in Point, values are to be read only where the status is kOk; elsewhere they are NaN. The
/// covariance is that of the detections; the rig counts as exact.
struct BatchResult {
  int num_cameras = 0;
  int64_t num_points = 0;
  std::vector<uint8_t> status;     ///< static_cast<uint8_t>(Status)
  std::vector<double> x, y, z;     ///< m, in world
  std::vector<double> covariance;  ///< m^2, [k * num_points + point] with k = xx, xy, xz, yy, yz, zz
  std::vector<double> chi_squared, rms_px;
  std::vector<int32_t> num_views;  ///< that carry the point
  std::vector<uint64_t> used;      ///< which they are: bit camera % 64 of [camera / 64 * num_points + point]

  Status StatusOf(int64_t point) const { return static_cast<Status>(status[point]); }
  bool Used(int camera, int64_t point) const { return used[camera / 64 * num_points + point] >> (camera % 64) & 1; }
};

/// TriangulatePoint for every point, to rounding: the same statuses, the same views. Points whose views all agree are solved
/// several at a time in vector registers (linear least squares on the rays, then Gauss-Newton through the lenses) and every
/// check of TriangulatePoint is made on them; any point that does not pass them all plainly goes to TriangulatePoint, as do
/// methods other than kRobust, kAllViews, kLinear and kMidpoint, and rigs with a wide-angle lens model or with one camera under
/// two names.
///
/// With `gauss_newton_steps` the iteration stops there where the next step would be below a tenth of a standard deviation.
/// The result of a point depends neither on the number of threads nor on the points beside it. Throws ContractViolation when
/// the arrays' sizes do not fit the rig, CancelledError when told to stop.
BatchResult TriangulateBatch(const PreparedRig& rig, const PointBatch& batch, const BatchOptions& options = {},
                             const RunContext& run = {});

}  // namespace mvstudio::triangulate
