#pragma once

#include <optional>
#include <vector>

#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib {

/// Measured relative pose of two nodes of a graph (cameras, or boards), whose poses are node_from_world.
struct PoseLink {
  int a = 0, b = 0;
  geometry::Rigid3 a_from_b;
  /// The point, metres, that a_from_b maps most accurately: there the errors of rotation and translation are independent.
  /// For cameras: the middle of the boards that both saw.
  Eigen::Vector3d anchor_in_b = Eigen::Vector3d::Zero();
  double weight = 1;  ///< > 0, of the squared error
};

/// Poses that are given, per node; empty: none.
using KnownPoses = std::vector<std::optional<geometry::Rigid3>>;

/// Connected groups of nodes, ascending within a group; largest group first, then by first node. Nodes of known pose count
/// as connected with each other.
std::vector<std::vector<int>> LinkedGroups(int num_nodes, const std::vector<PoseLink>& links, const KnownPoses& known = {});

/// Poses (node_from_world) along the maximum spanning tree (Prim), starting at the known nodes. A group without a known
/// node starts at its first node, which becomes the identity.
std::vector<geometry::Rigid3> ChainPoses(int num_nodes, const std::vector<PoseLink>& links, const KnownPoses& known = {});

/// Refines the rotations of `poses` to agree best with all links: linearised differences of rotation vectors, iteratively
/// reweighted. The weights first approximate the sum of absolute errors, then are Geman and McClure's, narrowed to three
/// times the median error. Known nodes stay fixed, and so does the first node of each group without one. Chatterjee,
/// Govindu, "Efficient and robust large-scale rotation averaging", ICCV 2013; Hartley, Trumpf, Dai, Li, "Rotation
/// averaging", IJCV 2013.
void AverageRotations(const std::vector<PoseLink>& links, const KnownPoses& known, std::vector<geometry::Rigid3>* poses);

/// Positions of the nodes for given rotations: the same reweighted least squares, of the positions of the links' anchors.
/// The links carry the scale.
void AverageTranslations(const std::vector<PoseLink>& links, const KnownPoses& known, std::vector<geometry::Rigid3>* poses);

}  // namespace mvstudio::calib
