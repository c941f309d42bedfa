#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "bench/quality.h"
#include "geometry/rig/rig.h"
#include "triangulate/batch/batch.h"

namespace mvstudio::bench {

/// One line: one method on one problem.
struct TriangulationRow {
  std::string problem, method;
  std::string precision = "double";
  int views = 0;
  int64_t points = 0;
  int threads = 1;
  double points_per_s = 0;
  double rms_error_mm = 0, median_error_mm = 0;  ///< against the truth, of the points that were not refused
  double refused = 0;                            ///< share of the points answered with a status
  std::string peer;                              ///< whose method it is; empty: ours
};

struct TriangulationProblem {
  std::string name;
  geometry::Rig rig;
  std::vector<Eigen::Vector3d> truth;  // (points), m, in world
  triangulate::PointBatch batch;
};

/// Cameras of 1500 px focal length on a ring of 3 m around points in a cube of 1 m, 1 px of noise; the same points for every
/// number of cameras. `distorted`: Brown lenses as strong as those of the CMU Panoptic studio. `num_wrong` views of each point
/// are random pixels.
TriangulationProblem MakeTriangulationProblem(const std::string& name, int views, int64_t points, bool distorted, int num_wrong,
                                              uint64_t seed);

/// Points a second over points, views and threads, as one HTML page.
void WriteScalingFigure(const std::vector<TriangulationRow>& rows, const std::string& path);

}  // namespace mvstudio::bench
