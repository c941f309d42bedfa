#pragma once

#include <Eigen/Core>
#include <vector>

namespace mvstudio::body {

/// A triangle mesh in one place.
struct Surface {
  Eigen::Matrix3Xd vertices;  // (3, V) metres
  Eigen::Matrix3Xi faces;     // (3, F) counter-clockwise seen from outside
};

/// The triangles of a surface in a tree of boxes, for the nearest point and for rays. Exact: no sampling.
class SurfaceTree {
 public:
  /// At least one face, finite vertices; ContractViolation otherwise. The surface is copied.
  explicit SurfaceTree(Surface surface);
  const Surface& surface() const { return surface_; }

  struct Nearest {
    int face = -1;
    double distance_m = 0;
    Eigen::Vector3d weights;  ///< of the face's corners, sum 1, not negative: where the nearest point lies
  };
  /// The point of the surface nearest to a finite `x`.
  Nearest Find(const Eigen::Vector3d& x) const;

  /// Whether the ray from `origin` meets a face farther than `least_m` away along the unit `direction`, from either side.
  bool Meets(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double least_m) const;

 private:
  struct Node {
    Eigen::Vector3d low, high;
    int first = 0, count = 0;  // faces order_[first …], a leaf; count 0: children are this + 1 and `first`
  };
  int Build(int first, int last);
  void FindIn(int node, const Eigen::Vector3d& x, Nearest* nearest) const;

  Surface surface_;
  Eigen::Matrix3Xd centroids_;
  std::vector<int> order_;
  std::vector<Node> nodes_;
};

}  // namespace mvstudio::body
