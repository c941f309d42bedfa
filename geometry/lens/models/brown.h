#pragma once

#include <algorithm>
#include <array>

#include "geometry/lens/models/decentred.h"
#include "geometry/lens/models/perspective.h"
#include "geometry/lens/models/polynomial.h"

namespace mvstudio::geometry::internal {

/// The terms of OpenCV's perspective lenses, in OpenCV's order. The models of this family have the first few of them.
inline constexpr std::array<LensParam, 12> kBrownParams = {
    LensParam{LensRole::kNumerator, 2, "k1", -0.12},
    LensParam{LensRole::kNumerator, 4, "k2", 0.06},
    kDecentringParams[0],
    kDecentringParams[1],
    LensParam{LensRole::kNumerator, 6, "k3", -0.010},
    LensParam{LensRole::kDenominator, 2, "k4", 0.010},
    LensParam{LensRole::kDenominator, 4, "k5", 0.004},
    LensParam{LensRole::kDenominator, 6, "k6", 0.001},
    LensParam{LensRole::kPrism, 1, "s1", 3e-4},
    LensParam{LensRole::kPrism, 3, "s2", -1e-4},
    LensParam{LensRole::kPrism, 1, "s3", -2e-4},
    LensParam{LensRole::kPrism, 3, "s4", 1e-4},
};

// T may be a vector of the compiler's. What takes and returns it is always inlined: its calling convention does not matter.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpsabi"

/// D. C. Brown, "Decentering distortion of lenses", 1966, in OpenCV's parametrisation: with a = x / z, b = y / z, s = a^2 + b^2
///   L  = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)
///   a' = a L + 2 p1 a b + p2 (s + 2 a^2) + s1 s + s2 s^2,   b' = b L + p1 (s + 2 b^2) + 2 p2 a b + s3 s + s4 s^2,
/// of which `kCount` terms are there, counted in OpenCV's order.
template <class Lens, int kCount>
struct Brown : Perspective<Lens> {
  static constexpr auto kParams = FirstOf<kCount>(kBrownParams);
  static constexpr bool kOpenCv = true;

  template <class S, class T>
  [[gnu::always_inline]] static void Distort(const S* k, const T& a, const T& b, T* a_out, T* b_out) {
    const T s = a * a + b * b, factor = Factor(k, s);
    *a_out = a * factor, *b_out = b * factor;
    if constexpr (kCount >= 4) {
      *a_out = *a_out + DecentringOfA(k + 2, a, b, s);
      *b_out = *b_out + DecentringOfB(k + 2, a, b, s);
    }
    if constexpr (kCount >= 12) {
      *a_out = *a_out + s * (k[8] + s * k[9]);
      *b_out = *b_out + s * (k[10] + s * k[11]);
    }
  }

  template <class S, class T>
  [[gnu::always_inline]] static PlaneSlopes<T> Slopes(const S* k, const T& a, const T& b) {
    const T s = a * a + b * b, factor = Factor(k, s), slope = FactorSlope(k, s, factor);
    T a_by_a = factor + S(2) * (a * a) * slope, b_by_b = factor + S(2) * (b * b) * slope, cross = S(2) * (a * b) * slope;
    if constexpr (kCount >= 4) {
      a_by_a = a_by_a + (S(2) * k[2] * b + S(6) * k[3] * a);
      b_by_b = b_by_b + (S(6) * k[2] * b + S(2) * k[3] * a);
      cross = cross + (S(2) * k[2] * a + S(2) * k[3] * b);
    }
    if constexpr (kCount < 12) {
      return {a_by_a, cross, cross, b_by_b};
    } else {
      const T to_a = S(2) * (k[8] + S(2) * s * k[9]), to_b = S(2) * (k[10] + S(2) * s * k[11]);
      return {a_by_a + to_a * a, cross + to_a * b, cross + to_b * a, b_by_b + to_b * b};
    }
  }

  template <class Derivatives>
  static void ByParams(const double* k, double a, double b, Derivatives* derivatives) {
    auto& by_k = derivatives->d_px;
    const double s = a * a + b * b, inverse_d = InverseD(k, s), factor = Factor(k, s);
    const double a_n = a * inverse_d, b_n = b * inverse_d;
    by_k.col(4) << a_n * s, b_n * s;
    if constexpr (kCount >= 2) by_k.col(5) << a_n * s * s, b_n * s * s;
    if constexpr (kCount >= 4) {
      by_k.col(6) << 2 * a * b, s + 2 * b * b;
      by_k.col(7) << s + 2 * a * a, 2 * a * b;
    }
    if constexpr (kCount >= 5) by_k.col(8) << a_n * s * s * s, b_n * s * s * s;
    if constexpr (kCount >= 8) {
      double power = -factor * s;
      for (int i = 9; i < 12; ++i, power *= s) by_k.col(i) << a_n * power, b_n * power;
    }
    if constexpr (kCount >= 12) by_k.template middleCols<4>(12) << s, s * s, 0, 0, 0, 0, s, s * s;
  }

  /// r N / D with s = r^2.
  static RadialValue Radial(const double* k, double radius) {
    const double s = radius * radius, n = 1 + s * Rest(k, s);
    double dn = k[0];
    if constexpr (kCount >= 2 && kCount < 5) dn = k[0] + s * (2 * k[1]);
    if constexpr (kCount >= 5) dn = k[0] + s * (2 * k[1] + s * 3 * k[4]);
    if constexpr (kCount < 8) return {radius * n, n + 2 * s * dn};
    if constexpr (kCount >= 8) {
      const double d = 1 + s * (k[5] + s * (k[6] + s * k[7]));
      const double dd = k[5] + s * (2 * k[6] + s * 3 * k[7]);
      return {radius * n / d, n / d + 2 * s * (dn - n / d * dd) / d};
    }
  }

  static double FirstFold(const double* k) {
    Polynomial n = {1, k[0]};
    if constexpr (kCount >= 2) n.push_back(k[1]);
    if constexpr (kCount >= 5) n.push_back(k[4]);
    if constexpr (kCount < 8) return RootBelow(FirstPositiveRoot(SlopeNumerator(n, {1})));
    if constexpr (kCount >= 8) {
      const Polynomial d = {1, k[5], k[6], k[7]};
      return RootBelow(std::min(FirstPositiveRoot(d), FirstPositiveRoot(SlopeNumerator(n, d))));
    }
  }

 private:
  /// (N - 1) / s.
  template <class S, class T>
  [[gnu::always_inline]] static T Rest(const S* k, const T& s) {
    if constexpr (kCount == 1) return k[0] - T{};
    if constexpr (kCount >= 2 && kCount < 5) return k[0] + s * k[1];
    if constexpr (kCount >= 5) return k[0] + s * (k[1] + s * k[4]);
  }

  /// dN / ds = ((N - 1) / s) + s d/ds ((N - 1) / s).
  template <class S, class T>
  [[gnu::always_inline]] static T RestAndSlope(const S* k, const T& s) {
    const T rest = Rest(k, s);
    if constexpr (kCount == 1) return rest;
    if constexpr (kCount >= 2 && kCount < 5) return rest + s * k[1];
    if constexpr (kCount >= 5) return rest + s * (k[1] + s * (S(2) * k[4]));
  }

  template <class S, class T>
  [[gnu::always_inline]] static T InverseD(const S* k, const T& s) {
    if constexpr (kCount < 8) return S(1) - T{};
    if constexpr (kCount >= 8) return S(1) / (S(1) + s * (k[5] + s * (k[6] + s * k[7])));
  }

  /// L.
  template <class S, class T>
  [[gnu::always_inline]] static T Factor(const S* k, const T& s) {
    const T n = S(1) + s * Rest(k, s);
    if constexpr (kCount < 8) return n;
    if constexpr (kCount >= 8) return n * InverseD(k, s);
  }

  /// dL / ds.
  template <class S, class T>
  [[gnu::always_inline]] static T FactorSlope(const S* k, const T& s, const T& factor) {
    const T by_n = RestAndSlope(k, s);
    if constexpr (kCount < 8) return by_n;
    if constexpr (kCount >= 8) return (by_n - factor * (k[5] + s * (S(2) * k[6] + s * S(3) * k[7]))) * InverseD(k, s);
  }
};

#pragma GCC diagnostic pop

}  // namespace mvstudio::geometry::internal
