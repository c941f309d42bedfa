#pragma once

#include <array>
#include <limits>
#include <string_view>

namespace mvstudio::geometry {

/// What a distortion parameter does to the image.
enum class LensRole {
  kShape,        ///< shapes the radial function in a way of the model's own
  kNumerator,    ///< coefficients of r^2, r^4, … of N in the radial function r N(r^2) / D(r^2)
  kDenominator,  ///< the same of D
  kDecentring,   ///< Brown's p1, p2
  kPrism,        ///< of thin prisms: s1 … s4
};

/// A distortion parameter: what is asked of it where the formula does not matter.
struct LensParam {
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  std::string_view name;
  LensRole role = LensRole::kShape;
  double ordinary = 0;                        ///< of a lens as one buys it
  double start = 0;                           ///< where an adjustment starts that knows nothing of the lens
  double above = -kInfinity;                  ///< at this value and below it the formula is undefined on the optical axis
  double low = -kInfinity, high = kInfinity;  ///< adjustments stay within
  /// Perspective models: n for the coefficient of an nth power of image-plane coordinates, p r^n / r; 0: it is none.
  int degree = 0;

  constexpr LensParam() = default;
  constexpr LensParam(std::string_view param_name, double ordinary_value) : name(param_name), ordinary(ordinary_value) {}
  constexpr LensParam(LensRole its_role, int its_degree, std::string_view param_name, double ordinary_value)
      : name(param_name), role(its_role), ordinary(ordinary_value), degree(its_degree) {}

  constexpr LensParam Above(double value) const {
    LensParam changed = *this;
    changed.above = value;
    return changed;
  }
  constexpr LensParam StartsAt(double value) const {
    LensParam changed = *this;
    changed.start = value;
    return changed;
  }
  constexpr LensParam Within(double from, double to) const {
    LensParam changed = *this;
    changed.low = from, changed.high = to;
    return changed;
  }

  /// True for terms that make a lens differ between directions round its axis.
  constexpr bool IsAsymmetric() const { return role == LensRole::kDecentring || role == LensRole::kPrism; }
};

namespace internal {

template <size_t kCount, size_t kOf>
constexpr std::array<LensParam, kCount> FirstOf(const std::array<LensParam, kOf>& params) {
  std::array<LensParam, kCount> first;
  for (size_t i = 0; i < kCount; ++i) first[i] = params[i];
  return first;
}

template <size_t kA, size_t kB>
constexpr std::array<LensParam, kA + kB> Joined(const std::array<LensParam, kA>& a, const std::array<LensParam, kB>& b) {
  std::array<LensParam, kA + kB> both;
  for (size_t i = 0; i < kA; ++i) both[i] = a[i];
  for (size_t i = 0; i < kB; ++i) both[kA + i] = b[i];
  return both;
}

}  // namespace internal
}  // namespace mvstudio::geometry
