#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "avatar/body/dynamic/turn_basis.h"
#include "core/status.h"

/// A surface that moves with the pose: what linear blend skinning of bulging muscles and hanging cloth leaves open, linear in
/// the bones' rotations, as SMPL's pose blend shapes are (Loper et al., "SMPL: a skinned multi-person linear model", SIGGRAPH
/// Asia 2015).
namespace mvstudio::body {

/// What an outline says of a vertex's offset: direction . offset should grow by `gap_px`.
struct OffsetPull {
  int vertex = 0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< px per metre of the vertex at rest, in body
  double gap_px = 0, weight = 0;                        ///< 1 / px
};

/// How freely weights vary over the surface, for a value of one; all in metres but the strain.
struct OffsetStiffness {
  double laplacian_sigma_m = 5e-4;  ///< of a weight against the mean of its neighbours'
  double strain_sigma = 0.2;        ///< of the difference of two neighbours' weights, over their edge's length
  double offset_sigma_m = 0.005;    ///< of a weight itself
};

/// What stiffness alone asks of each column of weights: the normal matrix (V, V).
Eigen::SparseMatrix<double> StiffnessMatrix(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces,
                                            const OffsetStiffness& stiffness);

/// Weights (V, 3 K): the offset of vertex v at rest for values z (K) is sum_k z_k weights(v, 3 k + (0, 1, 2)), metres.
Eigen::Matrix3Xf OffsetsAt(const Eigen::MatrixXd& weights, const Eigen::VectorXd& values);

/// One Gauss-Newton step of the weights: `pulls[i]` were measured at them in time step i, whose values are `values[i]` (K).
/// Cauchy loss at 3 / weight, reweighted three times; conjugate gradients, preconditioned with stiffness and the mean
/// of the pulls on each vertex.
Status StepWeights(const Eigen::SparseMatrix<double>& stiffness, const std::vector<std::vector<OffsetPull>>& pulls,
                   const std::vector<Eigen::VectorXd>& values, Eigen::MatrixXd* weights);

/// Shrinks a vertex's weights until its offset is at most `most_m` for all `values`.
void LimitOffsets(const std::vector<Eigen::VectorXd>& values, double most_m, Eigen::MatrixXd* weights);

/// Offsets of a surface at rest, linear in the bones' turns.
struct LinearOffsets {
  TurnBasis basis;
  Eigen::MatrixXd weights;  ///< (V, 3 K) as above

  Eigen::Matrix3Xf At(const ArticulatedPose& pose) const;
};

/// Adds the offsets to a body's pose directions; its rest surface then stands for the rest pose.
void AddLinearOffsets(const LinearOffsets& offsets, BodyTemplate* body);

}  // namespace mvstudio::body
