#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "avatar/body/measure/surface_tree.h"
#include "core/status.h"

/// How far two surfaces are apart.
namespace mvstudio::body {

/// Distances of vertices that mean the same place.
struct VertexError {
  Status status = Status::kOk;  ///< kNonFiniteInput; kTooFewViews below 3 vertices, kDegenerate when they lie on a line
  double mean_m = 0;            ///< mean distance
  double procrustes_m = 0;      ///< the same after the similarity that brings them closest (Umeyama 1991)
};
/// `vertices` and `truth`: (3, V), in the same frame.
VertexError CompareVertices(const Eigen::Matrix3Xd& vertices, const Eigen::Matrix3Xd& truth);

/// Distances of points on one surface from another surface, means by area.
struct SurfaceDistance {
  double mean_m = 0, p95_m = 0;  ///< point to surface; p95: of points, not by area
  double normal_rad = 0;         ///< mean angle between the normals there and at the nearest points, 0 to pi
};

struct SurfaceError {
  Status status = Status::kOk;   ///< kNonFiniteInput; kDegenerate: a surface without faces or area
  SurfaceDistance to_truth;      ///< of points on the surface from the truth
  SurfaceDistance from_truth;    ///< of points on the truth from the surface
  double vertex_rms_m = 0;       ///< rms distance of the vertices of the surface's faces from the truth
  std::vector<double> vertex_m;  ///< (V) of each vertex; NaN where it belongs to no face
  double chamfer_m() const { return 0.5 * (to_truth.mean_m + from_truth.mean_m); }
  double normal_rad() const { return 0.5 * (to_truth.normal_rad + from_truth.normal_rad); }
};
/// Points are the faces' centroids. Normals are those of vertices, interpolated. Faces without area count nothing.
SurfaceError CompareSurfaces(const Surface& surface, const Surface& truth, int num_threads);

/// The faces that are seen from outside: from their centroid some of 64 directions, spread evenly, meets no face.
Surface SeenFromOutside(const Surface& surface, int num_threads);

}  // namespace mvstudio::body
