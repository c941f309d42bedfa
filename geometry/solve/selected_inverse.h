#pragma once

#include <Eigen/SparseCore>

namespace mvstudio::geometry {

/// Entries of the inverse of a symmetric positive definite matrix at the nonzeros of its Cholesky factor. These include
/// its diagonal and every block of the matrix itself (Takahashi, Fagan, Chin, 1973; Erisman and Tinney, 1975).
class SelectedInverse {
 public:
  /// Only the lower triangle of `matrix` is read. `ok()` is false when it is not positive definite.
  explicit SelectedInverse(const Eigen::SparseMatrix<double>& matrix);
  bool ok() const { return ok_; }
  double operator()(Eigen::Index row, Eigen::Index col) const;

 private:
  bool ok_ = false;
  Eigen::SparseMatrix<double> inverse_;  // lower triangle, in the factor's order
  Eigen::VectorXi order_;
};

}  // namespace mvstudio::geometry
