#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace mvstudio::body {

/// Values of an implicit function (negative inside) at the nodes of a regular grid, x fastest.
struct ScalarGrid {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // metres
  double step_m = 0;
  Eigen::Vector3i size = Eigen::Vector3i::Zero();  // nodes along x, y, z
  std::vector<float> values;                       // (nz, ny, nx)

  size_t Index(int x, int y, int z) const { return (static_cast<size_t>(z) * size[1] + y) * size[0] + x; }
  Eigen::Vector3d Node(int x, int y, int z) const { return origin + step_m * Eigen::Vector3d(x, y, z); }
};

struct TriangleMesh {
  Eigen::Matrix3Xf vertices;  // (3, V)
  Eigen::Matrix3Xi faces;     // (3, F) counter-clockwise seen from outside
};

/// Zero level set of a grid whose outermost nodes are all positive: one vertex in each cell that the surface intersects,
/// at the mean of its edge crossings. S. Gibson, "Constrained elastic surface nets", MICCAI 1998.
TriangleMesh SurfaceNets(const ScalarGrid& grid);

/// Moves vertices onto the zero level set of `value` by Newton steps along its numerical gradient.
void ProjectOntoLevelSet(const std::function<double(const Eigen::Vector3d&)>& value, double max_step_m, TriangleMesh* mesh);

/// Unit vertex normals, area-weighted means of the face normals. (3, V)
Eigen::Matrix3Xf VertexNormals(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces);

}  // namespace mvstudio::body
