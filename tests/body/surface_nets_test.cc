#include "avatar/body/surface_nets.h"

#include <Eigen/Geometry>
#include <cmath>
#include <map>

#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

ScalarGrid SphereGrid(double radius, double step) {
  ScalarGrid grid;
  grid.origin = Eigen::Vector3d::Constant(-1.3);
  grid.step_m = step;
  grid.size = Eigen::Vector3i::Constant(static_cast<int>(2.6 / step) + 1);
  grid.values.resize(grid.size.prod());
  for (int z = 0; z < grid.size[2]; ++z)
    for (int y = 0; y < grid.size[1]; ++y)
      for (int x = 0; x < grid.size[0]; ++x)
        grid.values[grid.Index(x, y, z)] = static_cast<float>(grid.Node(x, y, z).norm() - radius);
  return grid;
}

TEST(SurfaceNets, SphereIsClosedOrientedAndOnTheSurface) {
  TriangleMesh mesh = SurfaceNets(SphereGrid(1.0, 0.05));
  ProjectOntoLevelSet([](const Eigen::Vector3d& x) { return x.norm() - 1.0; }, 0.02, &mesh);
  std::map<std::pair<int, int>, int> edges;
  double volume = 0;
  for (int f = 0; f < mesh.faces.cols(); ++f) {
    const Eigen::Vector3i face = mesh.faces.col(f);
    for (int k = 0; k < 3; ++k) ++edges[{face[k], face[(k + 1) % 3]}];
    const Eigen::Vector3f a = mesh.vertices.col(face[0]), b = mesh.vertices.col(face[1]), c = mesh.vertices.col(face[2]);
    volume += a.dot(b.cross(c)) / 6;
  }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1u);
  }
  EXPECT_NEAR(volume, 4.0 / 3.0 * M_PI, 0.02);
  EXPECT_LT((mesh.vertices.colwise().norm().array() - 1).abs().maxCoeff(), 1e-5);
  const Eigen::Matrix3Xf normals = VertexNormals(mesh.vertices, mesh.faces);
  for (int i = 0; i < normals.cols(); ++i) EXPECT_GT(normals.col(i).dot(mesh.vertices.col(i)), 0.99);
  EXPECT_EQ(mesh.vertices.cols() - static_cast<int>(edges.size()) / 2 + mesh.faces.cols(), 2);  // Euler: genus 0
}

TEST(SurfaceNets, EmptyWhereNothingIsInside) {
  const TriangleMesh mesh = SurfaceNets(SphereGrid(-1.0, 0.2));
  EXPECT_EQ(mesh.vertices.cols(), 0);
  EXPECT_EQ(mesh.faces.cols(), 0);
}

}  // namespace
}  // namespace mvstudio::body
