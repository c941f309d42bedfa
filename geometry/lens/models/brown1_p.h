#pragma once

#include <array>

#include "geometry/lens/models/brown1.h"
#include "geometry/lens/models/brown4.h"

namespace mvstudio::geometry::internal {

/// Brown's lens with k1, p1, p2 (see brown.h): brown4 with k2 = 0.
struct Brown1P : Perspective<Brown1P> {
  static constexpr std::string_view kName = "brown1_p";
  static constexpr auto kParams = Joined(Brown1::kParams, kDecentringParams);
  static constexpr bool kOpenCv = true;
  using Simpler = Brown1;

  template <class S, class T>
  [[gnu::always_inline]] static void Distort(const S* k, const T& a, const T& b, T* a_out, T* b_out) {
    Brown4::Distort(WithK2(k).data(), a, b, a_out, b_out);
  }
  template <class S, class T>
  [[gnu::always_inline]] static PlaneSlopes<T> Slopes(const S* k, const T& a, const T& b) {
    return Brown4::Slopes(WithK2(k).data(), a, b);
  }
  template <class Derivatives>
  static void ByParams(const double* k, double a, double b, Derivatives* derivatives) {
    Brown4::ByParams(WithK2(k).data(), a, b, derivatives);
    derivatives->d_px.col(5) = derivatives->d_px.col(6);
    derivatives->d_px.col(6) = derivatives->d_px.col(7);
  }

  static RadialValue Radial(const double* k, double radius) { return Brown1::Radial(k, radius); }
  static double FirstFold(const double* k) { return Brown1::FirstFold(k); }

 private:
  template <class S>
  [[gnu::always_inline]] static std::array<S, 4> WithK2(const S* k) {
    return {k[0], S(0), k[1], k[2]};
  }
};

}  // namespace mvstudio::geometry::internal
