#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <vector>

namespace mvstudio::avatar {

/// Main diagonal and the one above it of an upper bidiagonal matrix.
struct Bidiagonal {
  std::vector<double> diagonal, above;
};

/// The bidiagonal matrix with the singular values of `m` (rows, columns), rows >= columns, float64 on the CPU, finite and
/// not near overflow. Householder reflections from both sides; both products of a step with the matrix are computed in one
/// pass over it (Howell, Demmel, Fulton, Hammarling, Marmol, "Cache efficient bidiagonalization using BLAS 2.5 operators",
/// TOMS 2008). Blocked as in Dongarra, Sorensen, Hammarling, "Block reduction of matrices to condensed forms", 1989.
/// LAPACK's version reads the matrix twice.
Bidiagonal Bidiagonalise(const at::Tensor& m);

/// Sum of the singular values, each within a few rounding errors of the largest: implicit QR (Golub, Kahan 1965; without
/// shift where a value is near zero: Demmel, Kahan 1990). Throws Error when it does not converge, which is not known to
/// happen.
double SumOfSingularValues(Bidiagonal b);

/// Nuclear norm of any float64 matrix on the CPU. Throws ContractViolation where it is not finite.
double NuclearNorm(const at::Tensor& m);

}  // namespace mvstudio::avatar
