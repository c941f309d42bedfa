#include "calib/rig/rotation_averaging.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <queue>

#include "calib/board/homography.h"
#include "core/check.h"
#include "core/statistics.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

bool IsKnown(const KnownPoses& known, int node) { return node < static_cast<int>(known.size()) && known[node].has_value(); }

/// First node of each group, or all known ones where a group has some.
std::vector<bool> FixedNodes(int num_nodes, const std::vector<PoseLink>& links, const KnownPoses& known) {
  std::vector<bool> fixed(num_nodes, false);
  for (const auto& group : LinkedGroups(num_nodes, links, known)) {
    bool any = false;
    for (int node : group) {
      if (IsKnown(known, node)) fixed[node] = any = true;
    }
    if (!any) fixed[group.front()] = true;
  }
  return fixed;
}

/// Minimises the weighted sum of |u_a - u_b - difference|^2 over a vector u per node, zero for the fixed ones.
class DifferenceSolver {
 public:
  DifferenceSolver(const std::vector<PoseLink>& links, const std::vector<bool>& fixed)
      : links_(links), column_(fixed.size(), -1) {
    for (size_t n = 0; n < fixed.size(); ++n) {
      if (!fixed[n]) column_[n] = num_free_++;
    }
  }

  /// u (3, nodes); nothing when the equations cannot be solved.
  std::optional<Eigen::Matrix3Xd> Solve(const Eigen::Matrix3Xd& differences, const Eigen::VectorXd& weights) const {
    Eigen::Matrix3Xd u = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(column_.size()));
    if (num_free_ == 0) return u;
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(num_free_, 3);
    for (size_t e = 0; e < links_.size(); ++e) {
      const int a = column_[links_[e].a], b = column_[links_[e].b];
      const double w = weights[static_cast<Eigen::Index>(e)];
      const Eigen::RowVector3d weighted = w * differences.col(static_cast<Eigen::Index>(e)).transpose();
      if (a >= 0) entries.emplace_back(a, a, w), right.row(a) += weighted;
      if (b >= 0) entries.emplace_back(b, b, w), right.row(b) -= weighted;
      if (a >= 0 && b >= 0) entries.emplace_back(a, b, -w), entries.emplace_back(b, a, -w);
    }
    Eigen::SparseMatrix<double> laplacian(num_free_, num_free_);
    laplacian.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(laplacian);
    if (solver.info() != Eigen::Success) return std::nullopt;
    const Eigen::MatrixXd free = solver.solve(right);
    if (!free.allFinite()) return std::nullopt;
    for (size_t n = 0; n < column_.size(); ++n) {
      if (column_[n] >= 0) u.col(static_cast<Eigen::Index>(n)) = free.row(column_[n]).transpose();
    }
    return u;
  }

 private:
  const std::vector<PoseLink>& links_;
  std::vector<int> column_;
  int num_free_ = 0;
};

/// Residual of a link at the current poses: the u_a - u_b that would remove it.
using ResidualOf = std::function<Eigen::Vector3d(const PoseLink&)>;
using Apply = std::function<void(const Eigen::Matrix3Xd&)>;

/// Iteratively reweighted steps; `floor`: residuals below it do not count as different.
void Reweight(const std::vector<PoseLink>& links, const std::vector<bool>& fixed, double floor, const ResidualOf& residual_of,
              const Apply& apply) {
  constexpr int kAbsolute = 25, kNarrowing = 40, kRobust = 80;
  constexpr double kLeastWeight = 1e-6;  // keeps the equations solvable where all links of a node are outliers
  const DifferenceSolver solver(links, fixed);
  const auto count = static_cast<Eigen::Index>(links.size());
  Eigen::Matrix3Xd residuals(3, count);
  Eigen::VectorXd weights(count);
  double scale = 0;
  for (int iteration = 0; iteration < kAbsolute + kRobust; ++iteration) {
    for (Eigen::Index e = 0; e < count; ++e) residuals.col(e) = residual_of(links[e]);
    const Eigen::VectorXd size = residuals.colwise().norm();
    const bool absolute = iteration < kAbsolute;
    if (absolute) {
      scale = floor;
    } else if (iteration < kAbsolute + kNarrowing) {
      // From far to near, so that the noise that a loop sums up is shared before it can count as one wrong link.
      const double wide = iteration == kAbsolute ? size.maxCoeff() : 0.7 * scale;
      scale = std::max({floor, 3 * kSigmaPerMad * Median(size), wide});
    }
    for (Eigen::Index e = 0; e < count; ++e) {
      const double ratio = size[e] / scale;
      const double robust = absolute ? 1 / std::max(1.0, ratio) : 1 / ((1 + ratio * ratio) * (1 + ratio * ratio));
      weights[e] = links[e].weight * std::max(kLeastWeight, robust);
    }
    const auto step = solver.Solve(residuals, weights);
    if (!step) return;
    apply(*step);
    if (iteration >= kAbsolute + kNarrowing && step->cwiseAbs().maxCoeff() < 1e-9 * floor) return;
  }
}

void CheckGraph(int num_nodes, const std::vector<PoseLink>& links, const KnownPoses& known) {
  MVS_CHECK(known.empty() || static_cast<int>(known.size()) == num_nodes, known.size() << " poses for " << num_nodes);
  for (const PoseLink& link : links) {
    MVS_CHECK(link.a >= 0 && link.b >= 0 && link.a < num_nodes && link.b < num_nodes && link.a != link.b,
              "link " << link.a << " - " << link.b << " of " << num_nodes << " nodes");
    MVS_CHECK(link.weight > 0 && std::isfinite(link.weight), "link " << link.a << " - " << link.b << " weighs " << link.weight);
  }
}

}  // namespace

std::vector<std::vector<int>> LinkedGroups(int num_nodes, const std::vector<PoseLink>& links, const KnownPoses& known) {
  CheckGraph(num_nodes, links, known);
  std::vector<int> parent(num_nodes);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int node) {
    while (parent[node] != node) node = parent[node] = parent[parent[node]];
    return node;
  };
  const auto join = [&](int a, int b) {
    const int low = std::min(root(a), root(b)), high = std::max(root(a), root(b));
    parent[high] = low;
  };
  for (const PoseLink& link : links) join(link.a, link.b);
  int first_known = -1;
  for (int n = 0; n < num_nodes; ++n) {
    if (!IsKnown(known, n)) continue;
    if (first_known < 0) first_known = n;
    join(first_known, n);
  }
  std::vector<std::vector<int>> groups(num_nodes);
  for (int n = 0; n < num_nodes; ++n) groups[root(n)].push_back(n);
  groups.erase(std::remove_if(groups.begin(), groups.end(), [](const auto& g) { return g.empty(); }), groups.end());
  std::stable_sort(groups.begin(), groups.end(), [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return groups;
}

std::vector<Rigid3> ChainPoses(int num_nodes, const std::vector<PoseLink>& links, const KnownPoses& known) {
  const std::vector<bool> start = FixedNodes(num_nodes, links, known);
  std::vector<Rigid3> poses(num_nodes);
  std::vector<bool> placed(num_nodes, false);
  std::vector<std::vector<int>> of_node(num_nodes);
  for (size_t e = 0; e < links.size(); ++e) {
    of_node[links[e].a].push_back(static_cast<int>(e));
    of_node[links[e].b].push_back(static_cast<int>(e));
  }
  std::priority_queue<std::pair<double, int>> open;  // weight, -link: ties go to the first link
  const auto place = [&](int node, const Rigid3& pose) {
    placed[node] = true, poses[node] = pose;
    for (int e : of_node[node]) open.push({links[e].weight, -e});
  };
  for (int n = 0; n < num_nodes; ++n) {
    if (start[n]) place(n, IsKnown(known, n) ? *known[n] : Rigid3());
  }
  while (!open.empty()) {
    const PoseLink& link = links[-open.top().second];
    open.pop();
    if (placed[link.a] && !placed[link.b]) {
      place(link.b, geometry::Inverse(link.a_from_b) * poses[link.a]);
    } else if (placed[link.b] && !placed[link.a]) {
      place(link.a, link.a_from_b * poses[link.b]);
    }
  }
  return poses;
}

void AverageRotations(const std::vector<PoseLink>& links, const KnownPoses& known, std::vector<Rigid3>* poses) {
  constexpr double kFloorRad = 1e-3;
  if (links.empty()) return;
  // node_from_world <- node_from_world * Exp(u): to first order u_a - u_b is what the link asks for, in world.
  const auto residual = [&](const PoseLink& link) -> Eigen::Vector3d {
    return geometry::RotationLog((*poses)[link.a].rotation.conjugate() * link.a_from_b.rotation * (*poses)[link.b].rotation);
  };
  const auto apply = [&](const Eigen::Matrix3Xd& u) {
    for (size_t n = 0; n < poses->size(); ++n) {
      Eigen::Quaterniond& rotation = (*poses)[n].rotation;
      rotation = (rotation * geometry::RotationExp(u.col(static_cast<Eigen::Index>(n)))).normalized();
    }
  };
  // The positions of the nodes in world stay where they are.
  std::vector<Eigen::Vector3d> centers;
  for (const Rigid3& pose : *poses) centers.push_back(geometry::Inverse(pose).translation);
  Reweight(links, FixedNodes(static_cast<int>(poses->size()), links, known), kFloorRad, residual, apply);
  for (size_t n = 0; n < poses->size(); ++n) (*poses)[n].translation = -((*poses)[n].rotation * centers[n]);
}

void AverageTranslations(const std::vector<PoseLink>& links, const KnownPoses& known, std::vector<Rigid3>* poses) {
  if (links.empty()) return;
  Eigen::VectorXd lengths(static_cast<Eigen::Index>(links.size()));
  for (size_t e = 0; e < links.size(); ++e) {
    const PoseLink& link = links[e];
    lengths[static_cast<Eigen::Index>(e)] = link.a_from_b.translation.norm() + link.anchor_in_b.norm();
  }
  const double floor = 1e-3 * std::max(1e-9, Median(lengths));
  Eigen::Matrix3Xd centers(3, static_cast<Eigen::Index>(poses->size()));
  for (size_t n = 0; n < poses->size(); ++n) {
    centers.col(static_cast<Eigen::Index>(n)) = geometry::Inverse((*poses)[n]).translation;
  }
  const auto residual = [&](const PoseLink& link) -> Eigen::Vector3d {
    const Eigen::Vector3d from_a = (*poses)[link.a].rotation.conjugate() * (link.a_from_b * link.anchor_in_b);
    const Eigen::Vector3d from_b = (*poses)[link.b].rotation.conjugate() * link.anchor_in_b;
    return (from_b + centers.col(link.b)) - (from_a + centers.col(link.a));
  };
  const auto apply = [&](const Eigen::Matrix3Xd& u) { centers += u; };
  Reweight(links, FixedNodes(static_cast<int>(poses->size()), links, known), floor, residual, apply);
  for (size_t n = 0; n < poses->size(); ++n) {
    (*poses)[n].translation = -((*poses)[n].rotation * centers.col(static_cast<Eigen::Index>(n)));
  }
}

}  // namespace mvstudio::calib
