#include "geometry/lens/models/polynomial.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mvstudio::geometry::internal {
namespace {

double Evaluate(const Polynomial& p, double s) {
  double value = 0;
  for (size_t i = p.size(); i-- > 0;) value = value * s + p[i];
  return value;
}

/// Bound on the rounding error of Evaluate.
double Rounding(const Polynomial& p, double s) {
  double sum = 0;
  for (size_t i = p.size(); i-- > 0;) sum = sum * s + std::abs(p[i]);
  return 4 * std::numeric_limits<double>::epsilon() * sum;
}

Polynomial Derivative(const Polynomial& p) {
  Polynomial d;
  for (size_t i = 1; i < p.size(); ++i) d.push_back(static_cast<double>(i) * p[i]);
  return d;
}

Polynomial Multiply(const Polynomial& a, const Polynomial& b) {
  Polynomial product(a.size() + b.size() - 1, 0.0);
  for (size_t i = 0; i < a.size(); ++i) {
    for (size_t j = 0; j < b.size(); ++j) product[i + j] += a[i] * b[j];
  }
  return product;
}

/// Cauchy's bound: every root has |s| <= bound; cut at 1e30, where tan(theta) has long lost its meaning, to keep powers finite.
double RootBound(const Polynomial& p) {
  double largest = 0;
  for (size_t i = 0; i + 1 < p.size(); ++i) largest = std::max(largest, std::abs(p[i] / p.back()));
  return std::min(1 + largest, 1e30);
}

/// Root of p between low and high, where its sign changes; the end on the side of `low`.
double Bisect(const Polynomial& p, double low, double high) {
  const bool negative = std::signbit(Evaluate(p, low));
  for (double mid = 0.5 * (low + high); mid > low && mid < high; mid = 0.5 * (low + high)) {
    (std::signbit(Evaluate(p, mid)) == negative ? low : high) = mid;
  }
  return low;
}

/// All roots in (0, inf), ascending; a double root, where p only touches zero, counts. Between two neighbouring roots of the
/// derivative p is monotone, so each interval holds at most one root.
std::vector<double> PositiveRoots(Polynomial p) {
  while (!p.empty() && p.back() == 0) p.pop_back();
  if (p.size() < 2) return {};
  std::vector<double> ends = PositiveRoots(Derivative(p));
  ends.push_back(std::max(RootBound(p), ends.empty() ? 0.0 : 2 * ends.back()));
  std::vector<double> roots;
  double low = 0;
  for (const double high : ends) {
    const double at_low = Evaluate(p, low), at_high = Evaluate(p, high);
    const bool touches = std::abs(at_high) <= Rounding(p, high) && high != ends.back();
    if (std::signbit(at_low) != std::signbit(at_high) && at_low != 0) {
      roots.push_back(Bisect(p, low, high));
    } else if (touches) {
      roots.push_back(high);
    }
    low = high;
  }
  return roots;
}

}  // namespace

double FirstPositiveRoot(const Polynomial& p) {
  const std::vector<double> roots = PositiveRoots(p);
  return roots.empty() ? std::numeric_limits<double>::infinity() : roots.front();
}

double RootBelow(double s) { return std::isinf(s) ? s : std::nextafter(std::sqrt(s), 0.0); }

Polynomial SlopeNumerator(const Polynomial& n, const Polynomial& d) {
  Polynomial weighted_n(n.size()), s_d(d.size());
  for (size_t i = 0; i < n.size(); ++i) weighted_n[i] = (2.0 * static_cast<double>(i) + 1) * n[i];
  for (size_t i = 0; i < d.size(); ++i) s_d[i] = 2.0 * static_cast<double>(i) * d[i];
  Polynomial slope = Multiply(weighted_n, d);
  const Polynomial minus = Multiply(n, s_d);
  for (size_t i = 0; i < slope.size(); ++i) slope[i] -= minus[i];
  return slope;
}

}  // namespace mvstudio::geometry::internal
