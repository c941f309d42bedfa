#pragma once

#include <Eigen/Core>
#include <vector>

namespace mvstudio::synth {

/// Points sorted into the cells of a regular grid, to find the nearest one within a cell's side.
class NearestVertex {
 public:
  /// `points` (3, N), finite, is copied. `reach_m` is the side of a cell.
  NearestVertex(const Eigen::Matrix3Xd& points, double reach_m);
  /// Index of the nearest point within the reach, -1 where there is none; the lower index of two that are equally near.
  int Find(const Eigen::Vector3d& x) const;

 private:
  Eigen::Vector3i Cell(const Eigen::Vector3d& x) const;

  Eigen::Matrix3Xd points_;
  double reach_m_;
  Eigen::Vector3d low_;
  Eigen::Vector3i size_;
  std::vector<int> begins_, order_;  // points of cell i: order_[begins_[i]] … order_[begins_[i + 1] - 1]
};

}  // namespace mvstudio::synth
