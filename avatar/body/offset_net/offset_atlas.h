#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <vector>

#include "avatar/body/body_template.h"

/// What a network of offsets knows of a body: the map of its surface, and which vertices are neighbours.
namespace mvstudio::body {

/// The 24 charts side by side, and where vertices lie in them.
struct OffsetAtlas {
  static constexpr int kTilePx = 16, kColumns = 6, kRows = 4;
  static constexpr int kWidth = kColumns * kTilePx, kHeight = kRows * kTilePx;
  std::vector<int> texels;     ///< (T) y * kWidth + x of those that show a face
  Eigen::Matrix3Xi corners;    ///< (3, T) the vertices of that face
  Eigen::Matrix3Xf shares;     ///< (3, T) barycentric coordinates in it
  Eigen::Matrix2Xf vertex_px;  ///< (2, V) x, y of each vertex by its first corner, half a texel or more inside its chart
  Eigen::Matrix<float, 5, Eigen::Dynamic>
      coordinates;  ///< (5, V) of the MLP: vertex_px in [-1, 1], rest position about the root
};

/// Throws ContractViolation for a body without charts.
OffsetAtlas MakeOffsetAtlas(const BodyTemplate& body);

/// Positions (3, kHeight * kWidth), row by row, of a surface (3, V); 0 where no face is.
Eigen::Matrix3Xf PositionMap(const OffsetAtlas& atlas, const Eigen::Matrix3Xf& vertices);

/// Smooths offsets over the surface: x solves (I + stiffness K) x = raw, K the Laplacian of the graph of edges. Gradients of x
/// become those of `raw` by the same matrix (Nicolet, Jacobson, Jakob, "Large steps in inverse rendering of geometry", SIGGRAPH
/// Asia 2021). x stays within the bounds of `raw`.
class OffsetSmoother {
 public:
  OffsetSmoother(const BodyTemplate& body, double stiffness);
  Eigen::Matrix3Xf Apply(const Eigen::Matrix3Xf& raw) const;

 private:
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver_;
};

}  // namespace mvstudio::body
