#pragma once

#include <vector>

/// Roots of the polynomials whose first positive one ends a lens's radial function.
namespace mvstudio::geometry::internal {

using Polynomial = std::vector<double>;  // coefficient of s^i at [i]

/// The smallest root in (0, inf), or infinity; a double root, where p only touches zero, counts.
double FirstPositiveRoot(const Polynomial& p);

/// Square root, rounded so that its square stays below a fold or pole at s.
double RootBelow(double s);

/// d/dr of r N(s) / D(s), s = r^2, times D^2: (N + 2 s N') D - 2 s N D'.
Polynomial SlopeNumerator(const Polynomial& n, const Polynomial& d);

}  // namespace mvstudio::geometry::internal
