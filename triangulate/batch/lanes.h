#pragma once

#include <cstdint>
#include <vector>

#include "geometry/lens/plane_distortion.h"
#include "triangulate/batch/batch.h"

/// The fast path of TriangulateBatch: several points at a time, one in each lane of a vector register. Internal to
/// batch.cc and lanes.cc.
namespace mvstudio::triangulate::internal {

/// A perspective camera in scalars of type S; see PreparedCamera.
template <class S>
struct LaneCamera {
  geometry::LensModel model = geometry::LensModel::kPinhole;
  S distortion[geometry::MaxPlaneParams()] = {};            // the lens's parameters after fx, fy, cx, cy
  S rotation[9] = {}, translation[3] = {}, center[3] = {};  // cam_from_local, row by row; metres
  double focal[2] = {}, principal[2] = {};                  // px
  S valid_radius_squared = 0;
  S mean_focal = 0;  // px a radian
};

template <class S>
struct LaneRig {
  std::vector<LaneCamera<S>> cameras;
  double extent = 0;  ///< m; no two centres are farther apart
};

/// Whether every lens is perspective, with a formula for vectors, and no camera occurs twice.
bool FitsLanes(const PreparedRig& rig);
template <class S>
LaneRig<S> MakeLaneRig(const PreparedRig& rig);

/// Writes a point whose `used` are cameras.
void StorePoint(const Point& point, int64_t i, BatchResult* result);

/// Solves points [first, first + count) and sets done[i - first] to 1 for those that were written: the points that pass
/// every check. In double, other points whose rays are all good are solved by TriangulateViews.
template <class S>
void SolveInLanes(const LaneRig<S>& rig, const PreparedRig& prepared, const PointBatch& batch, const BatchOptions& options,
                  int64_t first, int64_t count, BatchResult* result, uint8_t* done);

}  // namespace mvstudio::triangulate::internal
