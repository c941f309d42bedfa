#include "body/fit/offsets.h"

#include <Eigen/SparseCholesky>

#include "core/check.h"

namespace mvstudio::body {

using Triplets = std::vector<Eigen::Triplet<double>>;

Eigen::SparseMatrix<double> UmbrellaLaplacian(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces) {
  const Eigen::Index count = vertices.cols();
  Triplets edges;
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    for (int k = 0; k < 3; ++k) {
      const int a = faces(k, f), b = faces((k + 1) % 3, f);
      const double weight = 1 / std::max(1e-6, static_cast<double>((vertices.col(a) - vertices.col(b)).norm()));
      edges.emplace_back(a, b, weight), edges.emplace_back(b, a, weight);
    }
  }
  Eigen::SparseMatrix<double, Eigen::RowMajor> weights(count, count);
  weights.setFromTriplets(edges.begin(), edges.end());
  Triplets rows;
  for (Eigen::Index a = 0; a < count; ++a) {
    const double sum = weights.row(a).sum();
    if (!(sum > 0)) continue;
    rows.emplace_back(a, a, 1);
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(weights, a); it; ++it)
      rows.emplace_back(a, it.col(), -it.value() / sum);
  }
  Eigen::SparseMatrix<double> laplacian(count, count);
  laplacian.setFromTriplets(rows.begin(), rows.end());
  return laplacian;
}

Status StepOffsets(const Eigen::SparseMatrix<double>& laplacian, const std::vector<OffsetObservation>& observations,
                   const OffsetSmoothness& smoothness, Eigen::VectorXd* offsets) {
  constexpr double kCauchy2 = 9;
  MVS_CHECK(offsets->size() == laplacian.cols(), offsets->size() << " offsets for " << laplacian.cols() << " vertices");
  const double lap = 1 / (smoothness.laplacian_sigma_m * smoothness.laplacian_sigma_m);
  const double own = 1 / (smoothness.offset_sigma_m * smoothness.offset_sigma_m);
  Eigen::VectorXd diagonal = Eigen::VectorXd::Constant(offsets->size(), own);
  Eigen::VectorXd gradient = lap * (laplacian.transpose() * (laplacian * *offsets)) + own * *offsets;
  for (const OffsetObservation& seen : observations) {
    const double square = seen.weight * seen.weight, r2 = square * seen.gap_px * seen.gap_px;
    const double weight = square / (1 + r2 / kCauchy2);
    diagonal[seen.vertex] += weight * seen.scale * seen.scale;
    gradient[seen.vertex] -= weight * seen.scale * seen.gap_px;
  }
  if (!gradient.allFinite() || !diagonal.allFinite()) return Status::kNonFiniteInput;
  Eigen::SparseMatrix<double> h = lap * (laplacian.transpose() * laplacian);
  h += Eigen::SparseMatrix<double>(diagonal.asDiagonal());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(h);
  if (solver.info() != Eigen::Success) return Status::kDegenerate;
  const Eigen::VectorXd step = solver.solve(-gradient);
  if (!step.allFinite()) return Status::kDegenerate;
  *offsets += step;
  return Status::kOk;
}

}  // namespace mvstudio::body
