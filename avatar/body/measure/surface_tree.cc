#include "avatar/body/measure/surface_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/check.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector3d;

constexpr int kLeaf = 4;

/// Weights of the point of the segment a b that is nearest to x.
Vector3d OnEdge(const Vector3d& x, const Vector3d& a, const Vector3d& b, int ia, int ib) {
  const double square = (b - a).squaredNorm();
  const double t = square > 0 ? std::clamp((x - a).dot(b - a) / square, 0.0, 1.0) : 0;
  Vector3d weights = Vector3d::Zero();
  weights[ia] = 1 - t, weights[ib] = t;
  return weights;
}

/// Weights of the corners (columns) at the point of a triangle that is nearest to x: its foot where that lies inside, else the
/// best of the three edges.
Vector3d OnTriangle(const Vector3d& x, const Eigen::Matrix3d& corners) {
  const Vector3d a = corners.col(0), b = corners.col(1), c = corners.col(2);
  const Vector3d normal = (b - a).cross(c - a);
  const double square = normal.squaredNorm();
  if (square > 0) {
    const Vector3d weights((c - b).cross(x - b).dot(normal) / square, (a - c).cross(x - c).dot(normal) / square,
                           (b - a).cross(x - a).dot(normal) / square);
    if (weights.minCoeff() >= 0) return weights / weights.sum();
  }
  Vector3d best = OnEdge(x, a, b, 0, 1);
  for (const Vector3d& other : {OnEdge(x, b, c, 1, 2), OnEdge(x, c, a, 2, 0)}) {
    if ((corners * other - x).squaredNorm() < (corners * best - x).squaredNorm()) best = other;
  }
  return best;
}

double SquareFromBox(const Vector3d& x, const Vector3d& low, const Vector3d& high) {
  return (low - x).cwiseMax(x - high).cwiseMax(0).squaredNorm();
}

bool RayMeetsBox(const Vector3d& origin, const Vector3d& inverse, const Vector3d& low, const Vector3d& high) {
  double near = 0, far = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const double a = (low[k] - origin[k]) * inverse[k], b = (high[k] - origin[k]) * inverse[k];
    if (std::isnan(a) || std::isnan(b)) continue;  // along a face of the box
    near = std::max(near, std::min(a, b)), far = std::min(far, std::max(a, b));
  }
  return near <= far;
}

/// Moeller and Trumbore, "Fast, minimum storage ray-triangle intersection", 1997.
bool RayMeetsTriangle(const Vector3d& origin, const Vector3d& direction, const Eigen::Matrix3d& corners, double least_m) {
  const Vector3d ab = corners.col(1) - corners.col(0), ac = corners.col(2) - corners.col(0);
  const Vector3d p = direction.cross(ac), to = origin - corners.col(0), q = to.cross(ab);
  const double det = ab.dot(p);
  if (det == 0) return false;
  const double u = to.dot(p) / det, v = direction.dot(q) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && ac.dot(q) / det > least_m;
}

Eigen::Matrix3d Corners(const Surface& s, int face) {
  Eigen::Matrix3d corners;
  for (int k = 0; k < 3; ++k) corners.col(k) = s.vertices.col(s.faces(k, face));
  return corners;
}

}  // namespace

SurfaceTree::SurfaceTree(Surface surface) : surface_(std::move(surface)) {
  MVS_CHECK(surface_.faces.cols() > 0 && surface_.vertices.allFinite(), surface_.faces.cols() << " faces, or not finite");
  MVS_CHECK(surface_.faces.minCoeff() >= 0 && surface_.faces.maxCoeff() < surface_.vertices.cols(), "faces without vertices");
  const int count = static_cast<int>(surface_.faces.cols());
  centroids_.resize(3, count);
  for (int f = 0; f < count; ++f) centroids_.col(f) = Corners(surface_, f).rowwise().mean();
  order_.resize(count);
  std::iota(order_.begin(), order_.end(), 0);
  Build(0, count);
}

int SurfaceTree::Build(int first, int last) {
  const int index = static_cast<int>(nodes_.size());
  nodes_.push_back({Vector3d::Constant(1e300), Vector3d::Constant(-1e300), first, last - first});
  for (int i = first; i < last; ++i) {
    const Eigen::Matrix3d corners = Corners(surface_, order_[i]);
    nodes_[index].low = nodes_[index].low.cwiseMin(corners.rowwise().minCoeff());
    nodes_[index].high = nodes_[index].high.cwiseMax(corners.rowwise().maxCoeff());
  }
  if (last - first <= kLeaf) return index;
  Eigen::Index axis = 0;
  (nodes_[index].high - nodes_[index].low).maxCoeff(&axis);
  const int middle = (first + last) / 2;
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last,
                   [&](int a, int b) { return std::pair(centroids_(axis, a), a) < std::pair(centroids_(axis, b), b); });
  Build(first, middle);
  const int right = Build(middle, last);
  nodes_[index].first = right, nodes_[index].count = 0;
  return index;
}

SurfaceTree::Nearest SurfaceTree::Find(const Vector3d& x) const {
  MVS_CHECK(x.allFinite(), "a point that is not finite");
  Nearest nearest;
  nearest.distance_m = std::numeric_limits<double>::infinity();
  FindIn(0, x, &nearest);
  return nearest;
}

void SurfaceTree::FindIn(int index, const Vector3d& x, Nearest* nearest) const {
  const Node& node = nodes_[index];
  if (node.count == 0) {
    const int left = index + 1, right = node.first;
    const double to_left = SquareFromBox(x, nodes_[left].low, nodes_[left].high);
    const double to_right = SquareFromBox(x, nodes_[right].low, nodes_[right].high);
    const auto visit = [&](int child, double square) {
      if (square < nearest->distance_m * nearest->distance_m) FindIn(child, x, nearest);
    };
    if (to_left <= to_right) {
      visit(left, to_left), visit(right, to_right);
    } else {
      visit(right, to_right), visit(left, to_left);
    }
    return;
  }
  for (int i = node.first; i < node.first + node.count; ++i) {
    const Eigen::Matrix3d corners = Corners(surface_, order_[i]);
    const Vector3d weights = OnTriangle(x, corners);
    const double distance = (corners * weights - x).norm();
    if (distance < nearest->distance_m) *nearest = {order_[i], distance, weights};
  }
}

bool SurfaceTree::Meets(const Vector3d& origin, const Vector3d& direction, double least_m) const {
  const Vector3d inverse = direction.cwiseInverse();
  std::vector<int> open = {0};
  while (!open.empty()) {
    const int index = open.back();
    const Node& node = nodes_[index];
    open.pop_back();
    if (!RayMeetsBox(origin, inverse, node.low, node.high)) continue;
    if (node.count == 0) {
      open.push_back(index + 1), open.push_back(node.first);
      continue;
    }
    for (int i = node.first; i < node.first + node.count; ++i) {
      if (RayMeetsTriangle(origin, direction, Corners(surface_, order_[i]), least_m)) return true;
    }
  }
  return false;
}

}  // namespace mvstudio::body
