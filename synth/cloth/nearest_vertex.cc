#include "synth/cloth/nearest_vertex.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace mvstudio::synth {

NearestVertex::NearestVertex(const Eigen::Matrix3Xd& points, double reach_m) : points_(points), reach_m_(reach_m) {
  MVS_CHECK(points.cols() > 0 && points.allFinite() && reach_m > 0, points.cols() << " points, reach " << reach_m << " m");
  low_ = points.rowwise().minCoeff();
  const Eigen::Vector3d cells = (points.rowwise().maxCoeff() - low_) / reach_m;
  MVS_CHECK(cells.maxCoeff() < 1000, "points over " << cells.maxCoeff() << " cells");
  size_ = cells.array().floor().cast<int>() + 1;
  begins_.assign(static_cast<size_t>(size_[0]) * size_[1] * size_[2] + 1, 0);
  const auto index = [this](const Eigen::Vector3i& c) {
    return (static_cast<size_t>(c[2]) * size_[1] + c[1]) * size_[0] + c[0];
  };
  for (Eigen::Index i = 0; i < points.cols(); ++i) ++begins_[index(Cell(points.col(i))) + 1];
  for (size_t i = 1; i < begins_.size(); ++i) begins_[i] += begins_[i - 1];
  order_.resize(static_cast<size_t>(points.cols()));
  std::vector<int> next(begins_.begin(), begins_.end() - 1);
  for (Eigen::Index i = 0; i < points.cols(); ++i) order_[next[index(Cell(points.col(i)))]++] = static_cast<int>(i);
}

Eigen::Vector3i NearestVertex::Cell(const Eigen::Vector3d& x) const {
  return ((x - low_) / reach_m_).array().floor().cast<int>();
}

int NearestVertex::Find(const Eigen::Vector3d& x) const {
  if (!((x - low_).array() > -reach_m_).all() || !((x - low_).array() < reach_m_ * (size_.cast<double>().array() + 1)).all())
    return -1;
  const Eigen::Vector3i first = (Cell(x).array() - 1).max(0), last = (Cell(x).array() + 1).min(size_.array() - 1);
  double nearest = reach_m_ * reach_m_;
  int found = -1;
  for (int cz = first[2]; cz <= last[2]; ++cz) {
    for (int cy = first[1]; cy <= last[1]; ++cy) {
      const size_t row = (static_cast<size_t>(cz) * size_[1] + cy) * size_[0];
      for (int i = begins_[row + first[0]]; i < begins_[row + last[0] + 1]; ++i) {
        const int point = order_[i];
        const double distance = (points_.col(point) - x).squaredNorm();
        if (distance < nearest || (distance == nearest && point < found)) nearest = distance, found = point;
      }
    }
  }
  return found;
}

}  // namespace mvstudio::synth
