#pragma once

#include <type_traits>

namespace mvstudio::geometry {

/// Distorted image-plane coordinates and their derivatives by the undistorted ones. T may be a vector of the compiler's, whose
/// own alignment depends on the instruction set.
template <class T>
struct alignas(sizeof(T)) PlaneDistortion {
  T a, b, a_by_a, a_by_b, b_by_a, b_by_b;
};

/// Which terms a perspective lens has; those that it has not cost nothing.
enum class PlaneTerms {
  kDecentring,  ///< p1, p2 alone
  kPolynomial,  ///< and k1, k2, k3
  kAll,         ///< and k4, k5, k6, s1 … s4
};

/// The perspective formula of camera_model.h with its derivatives, for plain numbers and for vectors of them. `terms` has the
/// members of internal::LensTerms, of T's element type.
template <PlaneTerms kTerms, class T, class Terms>
[[gnu::always_inline]] inline PlaneDistortion<T> DistortPlane(const Terms& terms, const T& a, const T& b) {
  using S = std::decay_t<decltype(terms.p1)>;
  const auto& k = terms.radial;
  const T s = a * a + b * b;
  T radial = S(1) + S(0) * s, slope = S(0) * s;
  if constexpr (kTerms != PlaneTerms::kDecentring) {
    radial = S(1) + s * (k[0] + s * (k[1] + s * k[2]));
    slope = k[0] + s * (S(2) * k[1] + s * (S(3) * k[2]));
  }
  if constexpr (kTerms == PlaneTerms::kAll) {
    const T inverse = S(1) / (S(1) + s * (k[3] + s * (k[4] + s * k[5])));
    radial = radial * inverse;
    slope = (slope - radial * (k[3] + s * (S(2) * k[4] + s * (S(3) * k[5])))) * inverse;
  }
  const S p1 = S(2) * terms.p1, p2 = S(2) * terms.p2;
  const T cross = S(2) * (a * b) * slope + p1 * a + p2 * b;
  PlaneDistortion<T> m;
  m.a = a * radial + p1 * (a * b) + terms.p2 * (s + S(2) * (a * a));
  m.b = b * radial + terms.p1 * (s + S(2) * (b * b)) + p2 * (a * b);
  m.a_by_a = radial + S(2) * (a * a) * slope + p1 * b + S(3) * p2 * a;
  m.b_by_b = radial + S(2) * (b * b) * slope + S(3) * p1 * b + p2 * a;
  m.a_by_b = cross;
  m.b_by_a = cross;
  if constexpr (kTerms == PlaneTerms::kAll) {
    const auto& prism = terms.prism;
    const T to_a = S(2) * (prism[0] + (S(2) * prism[1]) * s), to_b = S(2) * (prism[2] + (S(2) * prism[3]) * s);
    m.a = m.a + s * (prism[0] + s * prism[1]);
    m.b = m.b + s * (prism[2] + s * prism[3]);
    m.a_by_a = m.a_by_a + to_a * a, m.a_by_b = m.a_by_b + to_a * b;
    m.b_by_a = m.b_by_a + to_b * a, m.b_by_b = m.b_by_b + to_b * b;
  }
  return m;
}

}  // namespace mvstudio::geometry
