#pragma once

#include <limits>

#include "geometry/lens/models/decentred.h"
#include "geometry/lens/models/perspective.h"

namespace mvstudio::geometry::internal {

/// (a', b') = (x, y) / z.
struct Pinhole : Perspective<Pinhole> {
  static constexpr std::string_view kName = "pinhole";
  static constexpr std::array<LensParam, 0> kParams = {};
  static constexpr bool kOpenCv = true;

  template <class S, class T>
  [[gnu::always_inline]] static void Distort(const S*, const T& a, const T& b, T* a_out, T* b_out) {
    *a_out = a, *b_out = b;
  }
  template <class S, class T>
  [[gnu::always_inline]] static PlaneSlopes<T> Slopes(const S*, const T&, const T&) {
    const T zero{}, one = S(1) - zero;
    return {one, zero, zero, one};
  }

  template <class Point, class Derivatives>
  static bool ProjectWithDerivatives(const double* k, const Eigen::Vector3d& x, Point* point, Derivatives* derivatives) {
    if (!Project(k, x, &point->a, &point->b)) return false;
    if (!derivatives) return true;
    const double w = 1 / x[2];
    point->by_x << w, 0, -point->a * w, 0, w, -point->b * w;
    return true;
  }

  static RadialValue Radial(const double*, double radius) { return {radius, 1}; }
  static double FirstFold(const double*) { return std::numeric_limits<double>::infinity(); }
  static double InvertRadial(const double*, double target, double) { return std::max(target, 0.0); }
};

/// A pinhole with Brown's p1, p2.
struct PinholeP : Decentred<Pinhole> {
  static constexpr std::string_view kName = "pinhole_p";

  template <class S, class T>
  [[gnu::always_inline]] static void Distort(const S* p, const T& a, const T& b, T* a_out, T* b_out) {
    Decentre(p, a, b, a_out, b_out);
  }
  template <class S, class T>
  [[gnu::always_inline]] static PlaneSlopes<T> Slopes(const S* p, const T& a, const T& b) {
    return DecentringSlopes(p, a, b);
  }
};

}  // namespace mvstudio::geometry::internal
