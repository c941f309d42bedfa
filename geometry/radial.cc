#include "geometry/radial.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/units.h"

namespace mvstudio::geometry {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
using Polynomial = std::vector<double>;  // coefficient of s^i at [i]

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

double FirstPositiveRoot(const Polynomial& p) {
  const std::vector<double> roots = PositiveRoots(p);
  return roots.empty() ? kInfinity : roots.front();
}

/// Square root, rounded so that its square stays below a fold or pole at s.
double RootBelow(double s) { return std::isinf(s) ? s : std::nextafter(std::sqrt(s), 0.0); }

Polynomial Numerator(const Distortion& k) { return {1, k[0], k[1], k[4]}; }
Polynomial Denominator(const Distortion& k) { return {1, k[5], k[6], k[7]}; }

/// d/dr of r N(s) / D(s), s = r^2, times D^2: (N + 2 s N') D - 2 s N D'.
Polynomial SlopeNumerator(const Polynomial& n, const Polynomial& d) {
  Polynomial weighted_n(n.size()), s_d(d.size());
  for (size_t i = 0; i < n.size(); ++i) weighted_n[i] = (2.0 * static_cast<double>(i) + 1) * n[i];
  for (size_t i = 0; i < d.size(); ++i) s_d[i] = 2.0 * static_cast<double>(i) * d[i];
  Polynomial slope = Multiply(weighted_n, d);
  const Polynomial minus = Multiply(n, s_d);
  for (size_t i = 0; i < slope.size(); ++i) slope[i] -= minus[i];
  return slope;
}

RadialValue EvaluateFisheye(const Distortion& k, double theta) {
  const double s = theta * theta;
  return {theta * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3])))),
          1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])))};
}

/// The upper end of a bracket for a radial function that never folds.
double GrowBracket(LensModel model, const Distortion& k, double target) {
  double high = std::max(target, 1e-3);
  while (high < 1e150 && EvaluateRadial(model, k, high).value < target) high *= 2;
  return high;
}

}  // namespace

RadialValue EvaluateRadial(LensModel model, const Distortion& k, double radius) {
  if (model == LensModel::kPinhole) return {radius, 1};
  if (model == LensModel::kKannalaBrandt4) return EvaluateFisheye(k, radius);
  const double s = radius * radius;
  const double n = 1 + s * (k[0] + s * (k[1] + s * k[4]));
  const double dn = k[0] + s * (2 * k[1] + s * 3 * k[4]);
  if (model != LensModel::kRational8) return {radius * n, n + 2 * s * dn};
  const double d = 1 + s * (k[5] + s * (k[6] + s * k[7]));
  const double dd = k[5] + s * (2 * k[6] + s * 3 * k[7]);
  return {radius * n / d, n / d + 2 * s * (dn - n / d * dd) / d};
}

double FirstFold(LensModel model, const Distortion& k) {
  if (model == LensModel::kPinhole) return kInfinity;
  if (model == LensModel::kKannalaBrandt4) {
    return std::min(kPi, RootBelow(FirstPositiveRoot({1, 3 * k[0], 5 * k[1], 7 * k[2], 9 * k[3]})));
  }
  const Polynomial n = Numerator(k);
  if (model != LensModel::kRational8) return RootBelow(FirstPositiveRoot(SlopeNumerator(n, {1})));
  const Polynomial d = Denominator(k);
  return RootBelow(std::min(FirstPositiveRoot(d), FirstPositiveRoot(SlopeNumerator(n, d))));
}

double InvertRadial(LensModel model, const Distortion& k, double target, double fold) {
  if (target <= 0 || model == LensModel::kPinhole) return std::max(target, 0.0);
  double low = 0, high = std::isinf(fold) ? GrowBracket(model, k, target) : fold;
  double radius = std::min(target, 0.5 * (low + high));
  for (int i = 0; i < 200; ++i) {
    const RadialValue at = EvaluateRadial(model, k, radius);
    // A value past a pole or an overflow is to the right of every target.
    (at.value < target ? low : high) = radius;
    const double newton = radius - (at.value - target) / at.slope;
    const double next = newton > low && newton < high ? newton : 0.5 * (low + high);
    if (at.value == target || next == radius || !(next > low && next < high)) return radius;
    radius = next;
  }
  return radius;
}

}  // namespace mvstudio::geometry
