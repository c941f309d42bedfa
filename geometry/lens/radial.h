#pragma once

#include "geometry/lens/camera.h"

/// The radial functions of the lens models alone: r_d(r) = r L(r^2) for Brown and rational lenses with r = tan(theta), and the
/// image-plane radius over theta for wide ones. Internal to geometry/ and to the batch kernel of triangulate/.
namespace mvstudio::geometry {

using internal::LensTerms;

/// The model with the same radial function and no decentring: kPinhole, kBrown5 for all Brown models, kRational8 (also for
/// thinprism12), kKannalaBrandt4, kUcm, kEucm, kDoubleSphere; kSplined for itself.
LensModel RadialFamily(LensModel model);
/// Not for kSplined.
LensTerms TermsOf(const Camera& camera);

struct RadialValue {
  double value = 0;
  double slope = 0;
};

/// Radial function and its derivative at `radius` (theta for wide models). `family` is one of RadialFamily.
RadialValue EvaluateRadial(LensModel family, const LensTerms& terms, double radius);

/// The largest radius such that the radial function is increasing and finite on [0, radius). Perspective and kannala4: first
/// positive root of the derivative's numerator or of the denominator; infinity when there is none, at most pi for kannala4.
/// ucm, eucm, doublesphere: in closed form, at most pi.
double FirstFold(LensModel family, const LensTerms& terms);
/// Supremum of the radial function on [0, fold).
double LargestRadius(LensModel family, const LensTerms& terms, double fold);

/// Solves radial(r) = target for r in [0, fold], where it increases: closed form polished by Newton's method, or Newton inside
/// a shrinking bracket. Needs 0 <= target <= LargestRadius.
double InvertRadial(LensModel family, const LensTerms& terms, double target, double fold);

}  // namespace mvstudio::geometry
