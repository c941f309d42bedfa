#include "geometry/lens/radial.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/units.h"
#include "geometry/lens/camera_model.h"

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

Polynomial Numerator(const LensTerms& t) { return {1, t.radial[0], t.radial[1], t.radial[2]}; }
Polynomial Denominator(const LensTerms& t) { return {1, t.radial[3], t.radial[4], t.radial[5]}; }

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

RadialValue EvaluateFisheye(const LensTerms& terms, double theta) {
  const auto& k = terms.radial;
  const double s = theta * theta;
  return {theta * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3])))),
          1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])))};
}

/// sin(theta) / D(theta) with D = p d + q shifted, shifted = cos(theta) + shift, d = sqrt(beta sin^2 + shifted^2).
/// Derivative of D: p d' - q sin.
RadialValue EvaluateSphere(double p, double q, double beta, double shift, double theta) {
  const double half = std::cos(theta / 2), sine = 2 * half * std::sin(theta / 2), cosine = std::cos(theta);
  const double shifted = 2 * half * half + (shift - 1), side2 = beta * sine * sine;
  const double d = std::sqrt(side2 + shifted * shifted), slope_d = d > 0 ? sine * (beta * cosine - shifted) / d : 0;
  const double denominator = SphereDenominator(p, q, side2, shifted, d), value = sine / denominator;
  return {value, (cosine - value * (p * slope_d - q * sine)) / denominator};
}

/// The largest psi for which sin(psi) / (alpha + (1 - alpha) cos(psi)) is defined and increasing, as its cosine.
double SphereLimitCosine(double alpha) { return alpha > 0.5 ? (alpha - 1) / alpha : alpha / (alpha - 1); }

double SphereFold(LensModel family, const LensTerms& terms) {
  const double p = terms.radial[0], q = terms.radial[1];
  if (family == LensModel::kUcm) return std::acos(p > 1 ? -1 / p : -p);
  const double cosine = SphereLimitCosine(family == LensModel::kEucm ? p : q), sine = std::sqrt(1 - cosine * cosine);
  if (family == LensModel::kEucm) return std::atan2(sine, cosine * std::sqrt(q));
  // Seen from the second centre, xi behind the first, the point on the sphere is at phi: sin(theta - phi) = xi sin(phi).
  if (p >= 1 && (cosine < 0 || p * sine > 1)) return std::acos(-1 / p);
  return std::min(kPi, std::atan2(sine, cosine) + std::asin(std::clamp(p * sine, -1.0, 1.0)));
}

/// psi of r = sin(psi) / (a + b cos(psi)), on the increasing branch: with delta = atan(r b), sin(psi - delta) = r a cos(delta).
double InvertSphere(double a, double b, double r) {
  return std::atan(r * b) + std::atan2(r * a, std::sqrt(std::max(0.0, 1 + r * r * (b - a) * (b + a))));
}

double InvertWideClosedForm(LensModel family, const LensTerms& terms, double target) {
  const double p = terms.radial[0], q = terms.radial[1];
  if (family == LensModel::kUcm) return InvertSphere(p, 1, target);
  if (family == LensModel::kEucm) {
    const double root = std::sqrt(q), psi = InvertSphere(p, 1 - p, target * root);
    return std::atan2(std::sin(psi), std::cos(psi) * root);
  }
  const double phi = InvertSphere(q, 1 - q, target);
  return phi + std::asin(std::clamp(p * std::sin(phi), -1.0, 1.0));
}

bool IsSphere(LensModel family) {
  return family == LensModel::kUcm || family == LensModel::kEucm || family == LensModel::kDoubleSphere;
}

/// Newton's method as long as it lowers the residual.
double InvertWide(LensModel family, const LensTerms& terms, double target, double fold) {
  double theta = std::clamp(InvertWideClosedForm(family, terms, target), 0.0, fold);
  RadialValue at = EvaluateRadial(family, terms, theta);
  for (int i = 0; i < 5 && at.value != target; ++i) {
    const double next = theta - (at.value - target) / at.slope;
    const RadialValue at_next = EvaluateRadial(family, terms, next);
    if (!(next >= 0 && next <= fold && std::abs(at_next.value - target) < std::abs(at.value - target))) break;
    theta = next, at = at_next;
  }
  return theta;
}

/// The upper end of a bracket for a radial function that never folds.
double GrowBracket(LensModel family, const LensTerms& terms, double target) {
  double high = std::max(target, 1e-3);
  while (high < 1e150 && EvaluateRadial(family, terms, high).value < target) high *= 2;
  return high;
}

void SetBrownTerms(const double* k, int count, LensTerms* terms) {
  terms->radial[0] = k[0];
  if (count > 1) terms->radial[1] = k[1];
  if (count > 2) terms->p1 = k[2], terms->p2 = k[3];
  for (int i = 4; i < std::min(count, 8); ++i) terms->radial[i - 2] = k[i];
  for (int i = 8; i < count; ++i) terms->prism[i - 8] = k[i];
}

}  // namespace

LensModel RadialFamily(LensModel model) {
  switch (model) {
    case LensModel::kPinholeP:
      return LensModel::kPinhole;
    case LensModel::kThinPrism12:
      return LensModel::kRational8;
    case LensModel::kKannalaBrandt4P:
      return LensModel::kKannalaBrandt4;
    case LensModel::kUcmP:
      return LensModel::kUcm;
    case LensModel::kEucmP:
      return LensModel::kEucm;
    case LensModel::kDoubleSphereP:
      return LensModel::kDoubleSphere;
    case LensModel::kBrown1:
    case LensModel::kBrown2:
    case LensModel::kBrown4:
    case LensModel::kBrown1P:
      return LensModel::kBrown5;
    default:
      return model;
  }
}

LensTerms TermsOf(const Camera& camera) {
  LensTerms terms;
  const double* k = camera.params.data() + 4;
  const int count = NumDistortionParams(camera.model);
  const LensModel family = RadialFamily(camera.model);
  const bool short_p = camera.model == LensModel::kPinholeP || camera.model == LensModel::kBrown1P;
  if (!IsWide(family) && !short_p) {
    if (count > 0) SetBrownTerms(k, count, &terms);
    return terms;
  }
  const bool decentred = short_p || family != camera.model;
  const int radial = decentred ? count - 2 : count;
  for (int i = 0; i < radial; ++i) terms.radial[i] = k[i];
  if (decentred) terms.p1 = k[radial], terms.p2 = k[radial + 1];
  return terms;
}

RadialValue EvaluateRadial(LensModel family, const LensTerms& terms, double radius) {
  const auto& k = terms.radial;
  if (family == LensModel::kPinhole) return {radius, 1};
  if (family == LensModel::kKannalaBrandt4) return EvaluateFisheye(terms, radius);
  if (family == LensModel::kUcm) return EvaluateSphere(0, 1, 1, k[0], radius);
  if (family == LensModel::kEucm) return EvaluateSphere(k[0], 1 - k[0], k[1], 0, radius);
  if (family == LensModel::kDoubleSphere) return EvaluateSphere(k[1], 1 - k[1], 1, k[0], radius);
  const double s = radius * radius;
  const double n = 1 + s * (k[0] + s * (k[1] + s * k[2]));
  const double dn = k[0] + s * (2 * k[1] + s * 3 * k[2]);
  if (family != LensModel::kRational8) return {radius * n, n + 2 * s * dn};
  const double d = 1 + s * (k[3] + s * (k[4] + s * k[5]));
  const double dd = k[3] + s * (2 * k[4] + s * 3 * k[5]);
  return {radius * n / d, n / d + 2 * s * (dn - n / d * dd) / d};
}

double FirstFold(LensModel family, const LensTerms& terms) {
  const auto& k = terms.radial;
  if (family == LensModel::kPinhole) return kInfinity;
  if (IsSphere(family)) return SphereFold(family, terms);
  if (family == LensModel::kKannalaBrandt4) {
    return std::min(kPi, RootBelow(FirstPositiveRoot({1, 3 * k[0], 5 * k[1], 7 * k[2], 9 * k[3]})));
  }
  const Polynomial n = Numerator(terms);
  if (family != LensModel::kRational8) return RootBelow(FirstPositiveRoot(SlopeNumerator(n, {1})));
  const Polynomial d = Denominator(terms);
  return RootBelow(std::min(FirstPositiveRoot(d), FirstPositiveRoot(SlopeNumerator(n, d))));
}

double LargestRadius(LensModel family, const LensTerms& terms, double fold) {
  const double p = terms.radial[0], q = terms.radial[1];
  if (family == LensModel::kUcm) return p > 1 ? 1 / std::sqrt((p - 1) * (p + 1)) : kInfinity;
  if (family == LensModel::kEucm) return p > 0.5 ? 1 / std::sqrt(q * (2 * p - 1)) : kInfinity;
  if (family == LensModel::kDoubleSphere) {
    // Either the second sphere's shadow ends (phi at its limit) or the first one's does (xi >= 1).
    const double at_fold = EvaluateRadial(family, terms, fold).value;
    const bool first_ends = p >= 1 && fold == std::acos(-1 / p);
    return first_ends ? at_fold : q > 0.5 ? 1 / std::sqrt(2 * q - 1) : kInfinity;
  }
  return std::isinf(fold) ? fold : EvaluateRadial(family, terms, fold).value;
}

double InvertRadial(LensModel family, const LensTerms& terms, double target, double fold) {
  if (target <= 0 || family == LensModel::kPinhole) return std::max(target, 0.0);
  if (IsSphere(family)) return InvertWide(family, terms, target, fold);
  double low = 0, high = std::isinf(fold) ? GrowBracket(family, terms, target) : fold;
  double radius = std::min(target, 0.5 * (low + high));
  for (int i = 0; i < 200; ++i) {
    const RadialValue at = EvaluateRadial(family, terms, radius);
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
