#include "synth/cloth/cloth_net.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

namespace mvstudio::synth {
namespace {

using Eigen::Vector3d;

class ClothNetBuilder {
 public:
  ClothNetBuilder(const DressedBody& dressed, const ClothMaterial& material) : dressed_(dressed), material_(material) {}

  ClothNet Build() {
    AddMasses();
    for (const Garment& g : dressed_.garments) AddEdges(g);
    net_.structural = net_.edges.size();
    for (const Garment& g : dressed_.garments) AddDiagonals(g), AddBends(g);
    for (size_t i = 1; i < dressed_.garments.size(); ++i) AddLayers(dressed_.garments[i - 1], dressed_.garments[i]);
    return std::move(net_);
  }

 private:
  Vector3d Rest(int i) const { return dressed_.surface.vertices.col(dressed_.body_vertices + i).cast<double>(); }
  int At(const Garment& g, int row, int column) const { return g.At(row, column) - dressed_.body_vertices; }

  /// A third of each face's mass for each of its corners.
  void AddMasses() {
    const auto& faces = dressed_.surface.faces;
    net_.mass_kg.assign(static_cast<size_t>(dressed_.surface.vertices.cols()) - dressed_.body_vertices, 0);
    for (Eigen::Index f = dressed_.body_faces; f < faces.cols(); ++f) {
      const Eigen::Vector3i c = faces.col(f).array() - dressed_.body_vertices;
      const double area = 0.5 * (Rest(c[1]) - Rest(c[0])).cross(Rest(c[2]) - Rest(c[0])).norm();
      for (int k = 0; k < 3; ++k) net_.mass_kg[c[k]] += material_.density_kg_m2 * area / 3;
    }
    for (const double mass : net_.mass_kg) net_.inverse_mass_kg.push_back(1 / mass);
    for (const Garment& g : dressed_.garments) {
      for (int r = 0; r < g.pinned_rows; ++r) {
        for (int c = 0; c < g.columns; ++c) net_.inverse_mass_kg[At(g, r, c)] = 0;
      }
    }
  }

  void AddEdge(int a, int b, double compliance) {
    if (net_.inverse_mass_kg[a] + net_.inverse_mass_kg[b] > 0)
      net_.edges.push_back({a, b, (Rest(a) - Rest(b)).norm(), compliance});
  }

  void AddEdges(const Garment& g) {
    for (int r = 0; r < g.rows; ++r) {
      for (int c = 0; c < g.columns; ++c) {
        if (r > 0) AddEdge(At(g, r - 1, c), At(g, r, c), material_.stretch_m_n);
        AddEdge(At(g, r, c), At(g, r, c + 1), material_.stretch_m_n);
      }
    }
  }

  void AddDiagonals(const Garment& g) {
    for (int r = 1; r < g.rows; ++r) {
      for (int c = 0; c < g.columns; ++c) {
        AddEdge(At(g, r - 1, c), At(g, r, c + 1), material_.shear_m_n);
        AddEdge(At(g, r - 1, c + 1), At(g, r, c), material_.shear_m_n);
      }
    }
  }

  void AddBend(int a, int b, int c) {
    if (net_.inverse_mass_kg[a] + net_.inverse_mass_kg[b] + net_.inverse_mass_kg[c] == 0) return;
    net_.bends.push_back({a, b, c, ((2 * Rest(b) - Rest(a) - Rest(c)) / 3).norm(), material_.bend_m_n});
  }

  void AddBends(const Garment& g) {
    for (int r = 0; r < g.rows; ++r) {
      for (int c = 0; c < g.columns; ++c) {
        if (r > 0 && r + 1 < g.rows) AddBend(At(g, r - 1, c), At(g, r, c), At(g, r + 1, c));
        AddBend(At(g, r, c - 1), At(g, r, c), At(g, r, c + 1));
      }
    }
  }

  /// Row of `inner` nearest in height.
  int RowAt(const Garment& inner, double z) const {
    int nearest = 0;
    for (int r = 0; r < inner.rows; ++r) {
      if (std::abs(Rest(At(inner, r, 0)).z() - z) < std::abs(Rest(At(inner, nearest, 0)).z() - z)) nearest = r;
    }
    return nearest;
  }

  void AddLayers(const Garment& inner, const Garment& outer) {
    const double top = Rest(At(inner, 0, 0)).z();
    for (int r = outer.pinned_rows; r < outer.rows; ++r) {
      const double z = Rest(At(outer, r, 0)).z();
      if (z > top) continue;
      const int row = RowAt(inner, z), up = std::max(0, row - 1), down = std::min(inner.rows - 1, row + 1);
      for (int c = 0; c < outer.columns; ++c) {
        net_.layers.push_back({At(outer, r, c), At(inner, row, c), At(inner, row, c - 1), At(inner, row, c + 1),
                               At(inner, up, c), At(inner, down, c)});
      }
    }
  }

  const DressedBody& dressed_;
  const ClothMaterial& material_;
  ClothNet net_;
};

}  // namespace

ClothNet MakeClothNet(const DressedBody& dressed, const ClothMaterial& material) {
  return ClothNetBuilder(dressed, material).Build();
}

}  // namespace mvstudio::synth
