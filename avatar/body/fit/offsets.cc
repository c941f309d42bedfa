#include "avatar/body/fit/offsets.h"

#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "geometry/solve/selected_inverse.h"

namespace mvstudio::body {

namespace {

using Triplets = std::vector<Eigen::Triplet<double>>;

/// Of a Cauchy loss at three standard deviations.
double RobustWeight(const OffsetObservation& seen) {
  constexpr double kCauchy = 3;
  const double square = seen.weight * seen.weight;
  return square / (1 + square * seen.gap_px * seen.gap_px / (kCauchy * kCauchy));
}

double InverseSquare(double sigma) { return 1 / (sigma * sigma); }

/// Gauss-Newton's, of the offsets (V, V).
Eigen::SparseMatrix<double> Hessian(const Eigen::SparseMatrix<double>& laplacian,
                                    const std::vector<OffsetObservation>& observations, const OffsetSmoothness& smoothness) {
  Eigen::VectorXd diagonal = Eigen::VectorXd::Constant(laplacian.cols(), InverseSquare(smoothness.offset_sigma_m));
  for (const OffsetObservation& seen : observations) diagonal[seen.vertex] += RobustWeight(seen) * seen.scale * seen.scale;
  Eigen::SparseMatrix<double> h = InverseSquare(smoothness.laplacian_sigma_m) * (laplacian.transpose() * laplacian);
  h += Eigen::SparseMatrix<double>(diagonal.asDiagonal());
  return h;
}

}  // namespace

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

OffsetSmoothness WideSmoothness(double laplacian_sigma_m, double prior_sigma_m) {
  return {laplacian_sigma_m, std::max(prior_sigma_m, 2 * prior_sigma_m * prior_sigma_m / laplacian_sigma_m)};
}

Status StepOffsets(const Eigen::SparseMatrix<double>& laplacian, const std::vector<OffsetObservation>& observations,
                   const OffsetSmoothness& smoothness, Eigen::VectorXd* offsets) {
  MVS_CHECK(offsets->size() == laplacian.cols(), offsets->size() << " offsets for " << laplacian.cols() << " vertices");
  Eigen::VectorXd gradient = InverseSquare(smoothness.laplacian_sigma_m) * (laplacian.transpose() * (laplacian * *offsets)) +
                             InverseSquare(smoothness.offset_sigma_m) * *offsets;
  for (const OffsetObservation& seen : observations) gradient[seen.vertex] -= RobustWeight(seen) * seen.scale * seen.gap_px;
  const Eigen::SparseMatrix<double> h = Hessian(laplacian, observations, smoothness);
  if (!gradient.allFinite() || !std::isfinite(h.sum())) return Status::kNonFiniteInput;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(h);
  if (solver.info() != Eigen::Success) return Status::kDegenerate;
  const Eigen::VectorXd step = solver.solve(-gradient);
  if (!step.allFinite()) return Status::kDegenerate;
  *offsets += step;
  return Status::kOk;
}

Eigen::VectorXd OffsetSigma(const Eigen::SparseMatrix<double>& laplacian,
                            const std::vector<std::vector<OffsetObservation>>& observations,
                            const OffsetSmoothness& smoothness) {
  std::vector<OffsetObservation> all;
  for (const auto& step : observations) all.insert(all.end(), step.begin(), step.end());
  const Eigen::SparseMatrix<double> h = Hessian(laplacian, all, smoothness);
  if (!std::isfinite(h.sum())) return {};
  const geometry::SelectedInverse covariance(h);
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(h);
  if (!covariance.ok() || solver.info() != Eigen::Success) return {};
  Eigen::VectorXd variance = Eigen::VectorXd::Zero(h.cols());
  double clusters = 0;
  for (const auto& step : observations) {
    if (step.empty()) continue;
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(h.cols());
    for (const OffsetObservation& seen : step) gradient[seen.vertex] += RobustWeight(seen) * seen.scale * seen.gap_px;
    variance += solver.solve(gradient).cwiseAbs2();
    ++clusters;
  }
  if (clusters > 1) variance *= clusters / (clusters - 1);
  for (Eigen::Index v = 0; v < h.cols(); ++v) variance[v] += covariance(v, v);
  return variance.cwiseSqrt();
}

Eigen::MatrixXd ShapeOffsets(const BodyTemplate& body, const Eigen::Matrix3Xf& normals) {
  const auto shapes = static_cast<Eigen::Index>(body.shapes.names.size());
  Eigen::MatrixXd offsets(body.vertices.cols(), shapes);
  for (Eigen::Index s = 0; s < shapes; ++s) {
    for (Eigen::Index v = 0; v < body.vertices.cols(); ++v) {
      Eigen::Vector3d moved = body.shapes.vertices.col(s).segment<3>(3 * v).cast<double>();
      for (int k = 0; k < 4; ++k)
        moved -= body.skin_weights(k, v) * body.shapes.heads.col(s).segment<3>(3 * body.skin_bones(k, v));
      offsets(v, s) = moved.dot(normals.col(v).cast<double>());
    }
  }
  return offsets;
}

Status StepCoefficients(const Eigen::MatrixXd& shape_offsets, const std::vector<OffsetObservation>& observations,
                        const Eigen::VectorXd& sigma, Eigen::VectorXd* coefficients) {
  Eigen::MatrixXd h = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
  Eigen::VectorXd gradient = h * *coefficients;
  for (const OffsetObservation& seen : observations) {
    const Eigen::VectorXd row = seen.scale * shape_offsets.row(seen.vertex).transpose();
    const double weight = RobustWeight(seen);
    h.noalias() += weight * row * row.transpose();
    gradient -= weight * seen.gap_px * row;
  }
  if (!h.allFinite() || !gradient.allFinite()) return Status::kNonFiniteInput;
  const Eigen::VectorXd step = h.ldlt().solve(-gradient);
  if (!step.allFinite()) return Status::kDegenerate;
  *coefficients += step;
  return Status::kOk;
}

std::vector<int> RotatedFaces(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& normals,
                              const Eigen::VectorXd& offsets) {
  const Eigen::Matrix3Xf moved = vertices + normals * offsets.cast<float>().asDiagonal();
  const auto normal = [&](const Eigen::Matrix3Xf& x, Eigen::Index f) -> Eigen::Vector3f {
    const Eigen::Vector3f a = x.col(faces(0, f)), b = x.col(faces(1, f)), c = x.col(faces(2, f));
    return (b - a).cross(c - a);
  };
  std::vector<int> rotated;
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    if (normal(moved, f).dot(normal(vertices, f)) < 0) rotated.push_back(static_cast<int>(f));
  }
  return rotated;
}

void UnfoldOffsets(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& normals,
                   const Eigen::SparseMatrix<double>& laplacian, Eigen::VectorXd* offsets) {
  constexpr int kSmoothings = 20, kShrinkings = 100;
  constexpr double kShrink = 0.8;
  for (int round = 0; round < kSmoothings + kShrinkings; ++round) {
    const std::vector<int> rotated = RotatedFaces(vertices, faces, normals, *offsets);
    if (rotated.empty()) return;
    const Eigen::VectorXd mean = *offsets - laplacian * *offsets;
    for (const int f : rotated) {
      for (int k = 0; k < 3; ++k) {
        const int v = faces(k, f);
        (*offsets)[v] = round < kSmoothings ? mean[v] : kShrink * (*offsets)[v];
      }
    }
  }
}

}  // namespace mvstudio::body
