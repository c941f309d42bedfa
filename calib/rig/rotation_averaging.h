#pragma once

#include <optional>
#include <vector>

#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {

/// Measured relative pose of two nodes of a graph (cameras, or boards), whose poses are node_from_world.
struct PoseLink {
  int a = 0, b = 0;
  geometry::Rigid3 a_from_b;
  /// The point, metres, that a_from_b maps best: there the errors of rotation and of translation are independent. For cameras
  /// the middle of the boards that both saw.
  Eigen::Vector3d anchor_in_b = Eigen::Vector3d::Zero();
  double weight = 1;  ///< > 0, of the squared error
};

/// Poses that are given, per node; empty: none.
using KnownPoses = std::vector<std::optional<geometry::Rigid3>>;

/// Nodes in ascending order that links connect, largest group first, then by their first node. Nodes of known pose are
/// connected with each other.
std::vector<std::vector<int>> LinkedGroups(int num_nodes, const std::vector<PoseLink>& links, const KnownPoses& known = {});

/// Poses (node_from_world) along the spanning tree with the largest weights (Prim), from the known nodes; a group without one
/// starts at its first node, which becomes the identity.
std::vector<geometry::Rigid3> ChainPoses(int num_nodes, const std::vector<PoseLink>& links, const KnownPoses& known = {});

/// Rotations of `poses` that agree best with all links: linearised differences of rotation vectors, iteratively reweighted,
/// first towards the sum of the absolute errors, then with Geman and McClure's weights, narrowing to three times the median
/// error. Known nodes and the first node of each group without one stay. Chatterjee, Govindu, "Efficient and robust large-scale
/// rotation averaging", ICCV 2013; Hartley, Trumpf, Dai, Li, "Rotation averaging", IJCV 2013.
void AverageRotations(const std::vector<PoseLink>& links, const KnownPoses& known, std::vector<geometry::Rigid3>* poses);

/// Positions of the nodes, given their rotations, by the same reweighted least squares of where the links' anchors meet. The
/// links carry the scale.
void AverageTranslations(const std::vector<PoseLink>& links, const KnownPoses& known, std::vector<geometry::Rigid3>* poses);

}  // namespace mvstudio::calib
