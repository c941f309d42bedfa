#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

#include "avatar/body/body_template.h"
#include "core/status.h"

namespace mvstudio::body {

/// One row a vertex: its value minus the mean of its neighbours', weighted by the inverse lengths of the edges (Fujiwara's
/// Laplacian: "Eigenvalues of Laplacians on a closed Riemannian manifold and its nets", 1995).
Eigen::SparseMatrix<double> UmbrellaLaplacian(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces);

/// An outline seen at a vertex: `scale` px per metre of offset, to move by `gap_px` from the present offset.
struct OffsetObservation {
  int vertex = 0;
  double scale = 0, gap_px = 0;
  double weight = 0;  ///< 1 / px
};

struct OffsetSmoothness {
  double laplacian_sigma_m = 1e-3;  ///< of an offset against the mean of its neighbours'
  double offset_sigma_m = 0.1;      ///< of an offset itself
};

/// Smoothness that leaves the offset of a vertex far from all observations about `prior_sigma_m` of its own. With both terms of
/// OffsetSmoothness that is sqrt(laplacian_sigma_m * offset_sigma_m / 2) on a flat, even mesh, much less than `offset_sigma_m`.
OffsetSmoothness WideSmoothness(double laplacian_sigma_m, double prior_sigma_m);

/// Offsets (V) along the rest normals, metres: one Gauss-Newton step from `offsets`, Cauchy loss at 3 / weight, sparse
/// Cholesky.
Status StepOffsets(const Eigen::SparseMatrix<double>& laplacian, const std::vector<OffsetObservation>& observations,
                   const OffsetSmoothness& smoothness, Eigen::VectorXd* offsets);

/// Standard deviations (V) of the offsets at StepOffsets' optimum, metres, from observations by time step. Those of one time
/// step err together (its pose, its masks), so their scatter between time steps is added to the posterior's variance: the
/// sandwich estimator for clusters (Liang and Zeger, "Longitudinal data analysis using generalized linear models", Biometrika
/// 1986). Where nothing was seen, smoothness and `offset_sigma_m` bound it. Empty when the problem is not positive definite.
Eigen::VectorXd OffsetSigma(const Eigen::SparseMatrix<double>& laplacian,
                            const std::vector<std::vector<OffsetObservation>>& observations,
                            const OffsetSmoothness& smoothness);

/// Faces whose normals turn over when `vertices` (3, V) move by `offsets` (V) along `normals` (3, V).
std::vector<int> RotatedFaces(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& normals,
                              const Eigen::VectorXd& offsets);

/// Smooths, then shrinks offsets about turned faces until none is turned.
void UnfoldOffsets(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& normals,
                   const Eigen::SparseMatrix<double>& laplacian, Eigen::VectorXd* offsets);

/// How far each shape of a body moves its vertices along the rest normals, its skeleton held: (V, S), metres per unit.
Eigen::MatrixXd ShapeOffsets(const BodyTemplate& body, const Eigen::Matrix3Xf& normals);

/// One Gauss-Newton step of the shapes' coefficients (S) with the standard deviations `sigma`, Cauchy loss as above.
Status StepCoefficients(const Eigen::MatrixXd& shape_offsets, const std::vector<OffsetObservation>& observations,
                        const Eigen::VectorXd& sigma, Eigen::VectorXd* coefficients);

}  // namespace mvstudio::body
