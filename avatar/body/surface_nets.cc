#include "avatar/body/surface_nets.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace mvstudio::body {
namespace {

/// Mean of the crossings on the 12 edges of a cell, or false when the surface does not cross it.
bool CellVertex(const ScalarGrid& grid, int x, int y, int z, Eigen::Vector3f* vertex) {
  double value[8];
  int inside = 0;
  for (int c = 0; c < 8; ++c) {
    value[c] = grid.values[grid.Index(x + (c & 1), y + ((c >> 1) & 1), z + (c >> 2))];
    inside += value[c] < 0;
  }
  if (inside == 0 || inside == 8) return false;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int crossings = 0;
  for (int c = 0; c < 8; ++c) {
    for (int axis = 0; axis < 3; ++axis) {
      const int d = c | (1 << axis);
      if (d == c || (value[c] < 0) == (value[d] < 0)) continue;
      Eigen::Vector3d at(c & 1, (c >> 1) & 1, c >> 2);
      at[axis] += value[c] / (value[c] - value[d]);
      sum += at;
      ++crossings;
    }
  }
  *vertex = (grid.Node(x, y, z) + grid.step_m * sum / crossings).cast<float>();
  return true;
}

/// The quad around a grid edge from `node` along `axis`, as two triangles.
void AddQuad(const ScalarGrid& grid, const std::vector<int>& cell_vertex, const Eigen::Vector3i& node, int axis, bool flip,
             std::vector<Eigen::Vector3i>* faces) {
  Eigen::Vector3i du = Eigen::Vector3i::Zero(), dv = Eigen::Vector3i::Zero();
  du[(axis + 1) % 3] = 1;
  dv[(axis + 2) % 3] = 1;
  auto vertex = [&](const Eigen::Vector3i& cell) { return cell_vertex[grid.Index(cell[0], cell[1], cell[2])]; };
  int a = vertex(node - du - dv), b = vertex(node - dv), c = vertex(node), d = vertex(node - du);
  if (flip) std::swap(b, d);
  faces->push_back({a, b, c});
  faces->push_back({a, c, d});
}

}  // namespace

TriangleMesh SurfaceNets(const ScalarGrid& grid) {
  MVS_CHECK(grid.values.size() == static_cast<size_t>(grid.size.cast<int64_t>().prod()), "grid of " << grid.values.size());
  const Eigen::Vector3i& n = grid.size;
  std::vector<int> cell_vertex(grid.values.size(), -1);
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3i> faces;
  for (int z = 0; z + 1 < n[2]; ++z) {
    for (int y = 0; y + 1 < n[1]; ++y) {
      for (int x = 0; x + 1 < n[0]; ++x) {
        Eigen::Vector3f vertex;
        if (!CellVertex(grid, x, y, z, &vertex)) continue;
        cell_vertex[grid.Index(x, y, z)] = static_cast<int>(vertices.size());
        vertices.push_back(vertex);
      }
    }
  }
  for (int z = 1; z + 1 < n[2]; ++z) {
    for (int y = 1; y + 1 < n[1]; ++y) {
      for (int x = 1; x + 1 < n[0]; ++x) {
        const bool inside = grid.values[grid.Index(x, y, z)] < 0;
        for (int axis = 0; axis < 3; ++axis) {
          const bool next = grid.values[grid.Index(x + (axis == 0), y + (axis == 1), z + (axis == 2))] < 0;
          if (inside != next) AddQuad(grid, cell_vertex, {x, y, z}, axis, next, &faces);
        }
      }
    }
  }
  TriangleMesh mesh;
  mesh.vertices = Eigen::Map<Eigen::Matrix3Xf>(vertices.empty() ? nullptr : vertices[0].data(), 3, vertices.size());
  mesh.faces = Eigen::Map<Eigen::Matrix3Xi>(faces.empty() ? nullptr : faces[0].data(), 3, faces.size());
  return mesh;
}

void ProjectOntoLevelSet(const std::function<double(const Eigen::Vector3d&)>& value, double max_step_m, TriangleMesh* mesh) {
  constexpr double kDelta = 1e-4;
  for (int i = 0; i < mesh->vertices.cols(); ++i) {
    Eigen::Vector3d x = mesh->vertices.col(i).cast<double>();
    for (int iteration = 0; iteration < 3; ++iteration) {
      const double f = value(x);
      Eigen::Vector3d gradient;
      for (int k = 0; k < 3; ++k) gradient[k] = (value(x + kDelta * Eigen::Vector3d::Unit(k)) - f) / kDelta;
      const double norm2 = gradient.squaredNorm();
      if (norm2 < 1e-4) break;
      Eigen::Vector3d step = -f / norm2 * gradient;
      if (step.norm() > max_step_m) step *= max_step_m / step.norm();
      x += step;
    }
    mesh->vertices.col(i) = x.cast<float>();
  }
}

Eigen::Matrix3Xf VertexNormals(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces) {
  Eigen::Matrix3Xf normals = Eigen::Matrix3Xf::Zero(3, vertices.cols());
  for (int f = 0; f < faces.cols(); ++f) {
    const Eigen::Vector3f a = vertices.col(faces(0, f));
    const Eigen::Vector3f normal = (vertices.col(faces(1, f)) - a).cross(vertices.col(faces(2, f)) - a);
    for (int k = 0; k < 3; ++k) normals.col(faces(k, f)) += normal;
  }
  for (int i = 0; i < normals.cols(); ++i) {
    const Eigen::Vector3d sum = normals.col(i).cast<double>();  // squares of tiny faces' sums leave the range of floats
    normals.col(i) = sum.norm() > 0 ? Eigen::Vector3f(sum.normalized().cast<float>()) : Eigen::Vector3f(0, 0, 1);
  }
  return normals;
}

}  // namespace mvstudio::body
