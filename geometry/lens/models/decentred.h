#pragma once

#include <Eigen/Core>
#include <array>

#include "geometry/lens/models/lens_base.h"

namespace mvstudio::geometry::internal {

inline constexpr std::array<LensParam, 2> kDecentringParams = {
    LensParam{LensRole::kDecentring, 1, "p1", 4e-4},
    LensParam{LensRole::kDecentring, 1, "p2", -3e-4},
};

// T may be a vector of the compiler's. What takes and returns it is always inlined: its calling convention does not matter.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpsabi"

/// What Brown's decentring (D. C. Brown, "Decentering distortion of lenses", 1966) adds to (a, b), s = a^2 + b^2:
///   2 p1 a b + p2 (s + 2 a^2)   and   p1 (s + 2 b^2) + 2 p2 a b.
template <class S, class T>
[[gnu::always_inline]] inline T DecentringOfA(const S* p, const T& a, const T& b, const T& s) {
  return S(2) * p[0] * a * b + p[1] * (s + S(2) * a * a);
}
template <class S, class T>
[[gnu::always_inline]] inline T DecentringOfB(const S* p, const T& a, const T& b, const T& s) {
  return p[0] * (s + S(2) * b * b) + S(2) * p[1] * a * b;
}
/// (a, b) with that added, and its derivatives.
template <class S, class T>
[[gnu::always_inline]] inline void Decentre(const S* p, const T& a, const T& b, T* a_out, T* b_out) {
  const T s = a * a + b * b;
  *a_out = a + DecentringOfA(p, a, b, s);
  *b_out = b + DecentringOfB(p, a, b, s);
}
template <class S, class T>
[[gnu::always_inline]] inline PlaneSlopes<T> DecentringSlopes(const S* p, const T& a, const T& b) {
  const T cross = S(2) * (p[0] * a + p[1] * b);
  return {S(1) + S(2) * p[0] * b + S(6) * p[1] * a, cross, cross, S(1) + S(6) * p[0] * b + S(2) * p[1] * a};
}

#pragma GCC diagnostic pop

/// `Base` with Brown's p1, p2 on top, as its last parameters: (a, b) is Base's point of the image plane, then
///   a' = a + 2 p1 a b + p2 (s + 2 a^2),   b' = b + p1 (s + 2 b^2) + 2 p2 a b.
template <class Base>
struct Decentred : Base {
  using Simpler = Base;
  static constexpr auto kParams = Joined(Base::kParams, kDecentringParams);
  static constexpr int kFirst = static_cast<int>(Base::kParams.size());  // of p1, p2

  template <class T>
  static bool Project(const T* k, const Eigen::Matrix<T, 3, 1>& x, T* a, T* b) {
    T base_a, base_b;
    if (!Base::Project(k, x, &base_a, &base_b)) return false;
    Decentre(k + kFirst, base_a, base_b, a, b);
    return true;
  }

  template <class Point, class Derivatives>
  static bool ProjectWithDerivatives(const double* k, const Eigen::Vector3d& x, Point* point, Derivatives* derivatives) {
    Point base;
    if (!Base::ProjectWithDerivatives(k, x, &base, derivatives)) return false;
    const double a = base.a, b = base.b, s = a * a + b * b;
    double decentred_a, decentred_b;
    Decentre(k + kFirst, a, b, &decentred_a, &decentred_b);
    point->a = decentred_a, point->b = decentred_b;
    if (!derivatives) return true;
    const PlaneSlopes<double> m = DecentringSlopes(k + kFirst, a, b);
    Eigen::Matrix<typename Point::Scalar, 2, 2> jacobian;
    jacobian << m.a_by_a, m.a_by_b, m.b_by_a, m.b_by_b;
    point->by_x = jacobian * base.by_x;
    auto& by_k = derivatives->d_px;
    for (int i = 4; i < 4 + kFirst; ++i) by_k.col(i) = (jacobian * by_k.col(i)).eval();
    by_k.col(4 + kFirst) << 2 * a * b, s + 2 * b * b;
    by_k.col(5 + kFirst) << s + 2 * a * a, 2 * a * b;
    return true;
  }
};

}  // namespace mvstudio::geometry::internal
