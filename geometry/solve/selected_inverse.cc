#include "geometry/solve/selected_inverse.h"

#include <Eigen/SparseCholesky>
#include <algorithm>

#include "core/check.h"

namespace mvstudio::geometry {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

/// Z_rj = -sum_k L_kj Z_rk over the rows k of column j, the columns to the right being known; Z_jj = 1 / D_j - sum_k L_kj Z_kj.
Sparse TakahashiInverse(const Sparse& factor, const Eigen::VectorXd& diagonal) {
  Sparse inverse = factor;  // the same pattern; unit lower triangular with its diagonal
  const int* begin = factor.outerIndexPtr();
  const int* rows = factor.innerIndexPtr();
  const double* l = factor.valuePtr();
  double* z = inverse.valuePtr();
  std::vector<int> at(static_cast<size_t>(factor.cols()), -1);
  std::vector<double> sums;
  for (int j = static_cast<int>(factor.cols()) - 1; j >= 0; --j) {
    const int first = begin[j] + 1, last = begin[j + 1];  // below the diagonal
    sums.assign(static_cast<size_t>(last - first), 0);
    for (int e = first; e < last; ++e) at[static_cast<size_t>(rows[e])] = e - first;
    for (int e = first; e < last; ++e) {
      const int k = rows[e];
      sums[static_cast<size_t>(e - first)] += l[e] * z[begin[k]];
      for (int m = begin[k] + 1; m < begin[k + 1]; ++m) {
        const int r = at[static_cast<size_t>(rows[m])];
        if (r < 0) continue;
        sums[static_cast<size_t>(r)] += l[e] * z[m];
        sums[static_cast<size_t>(e - first)] += l[first + r] * z[m];
      }
    }
    double own = 1 / diagonal[j];
    for (int e = first; e < last; ++e) {
      z[e] = -sums[static_cast<size_t>(e - first)];
      own -= l[e] * z[e];
      at[static_cast<size_t>(rows[e])] = -1;
    }
    z[begin[j]] = own;
  }
  return inverse;
}

}  // namespace

SelectedInverse::SelectedInverse(const Eigen::SparseMatrix<double>& matrix) {
  const Eigen::SimplicialLDLT<Sparse> factor(matrix);
  if (factor.info() != Eigen::Success || !(factor.vectorD().array() > 0).all()) return;
  Sparse lower = factor.matrixL();
  lower.makeCompressed();
  inverse_ = TakahashiInverse(lower, factor.vectorD());
  order_ = factor.permutationP().indices();
  ok_ = true;
}

double SelectedInverse::operator()(Eigen::Index row, Eigen::Index col) const {
  const int a = order_[row], b = order_[col];
  const int r = std::max(a, b), c = std::min(a, b);
  const int* begin = inverse_.innerIndexPtr() + inverse_.outerIndexPtr()[c];
  const int* end = inverse_.innerIndexPtr() + inverse_.outerIndexPtr()[c + 1];
  const int* found = std::lower_bound(begin, end, r);
  MVS_CHECK(found != end && *found == r, "entry " << row << ", " << col << " lies outside the factor's pattern");
  return inverse_.valuePtr()[found - inverse_.innerIndexPtr()];
}

}  // namespace mvstudio::geometry
