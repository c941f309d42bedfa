#pragma once

// Vectors of 32 bytes pass by value between functions that are all inlined, so their calling convention does not matter.
// Without AVX the compiler aligns them to 16 bytes, with AVX it relies on 32: hence `aligned`, and alignas in
// PlaneDistortion.
#pragma GCC diagnostic ignored "-Wpsabi"
#pragma GCC diagnostic ignored "-Wignored-attributes"

#include <cstdint>
#include <limits>

#define MVS_INLINE [[gnu::always_inline]] inline

/// Values in the lanes of a vector register, and the algebra on them that triangulation needs. Internal to lanes.cc.
namespace mvstudio::triangulate::internal {

template <class S>
struct Lanes;
template <>
struct Lanes<double> {
  typedef double Value __attribute__((vector_size(32), aligned(32)));
  typedef int64_t Mask __attribute__((vector_size(32), aligned(32)));
  static constexpr int kWidth = 4, kSteps = 4;
  // Squares: of a negligible step, of the smallest reliable ratio of eigenvalues; a residual in px.
  static constexpr double kTinyStep = 1e-12, kMaxCondition = 1e10, kMinDeterminant = 1e-8, kUnprojectPx = 1e-9;
};
template <>
struct Lanes<float> {
  typedef float Value __attribute__((vector_size(32), aligned(32)));
  typedef int32_t Mask __attribute__((vector_size(32), aligned(32)));
  static constexpr int kWidth = 8, kSteps = 3;
  static constexpr float kTinyStep = 1e-4f, kMaxCondition = 1e4f, kMinDeterminant = 1e-4f, kUnprojectPx = 1e-2f;
};
template <class S>
using Value = typename Lanes<S>::Value;
template <class S>
using Mask = typename Lanes<S>::Mask;
static_assert(alignof(Lanes<double>::Value) == 32 && alignof(Lanes<float>::Mask) == 32);

template <class S>
MVS_INLINE Value<S> Broadcast(S x) {
  return x - Value<S>{};
}

/// The first `count` values minus `origin`, over `unit`; then NaN. Computed in double, because pixel coordinates have many
/// digits.
template <class S>
MVS_INLINE Value<S> Load(const double* from, int count, double origin = 0, double unit = 1) {
  Value<S> x = Broadcast<S>(std::numeric_limits<S>::quiet_NaN());
  if (count == Lanes<S>::kWidth) {
    for (int l = 0; l < Lanes<S>::kWidth; ++l) x[l] = static_cast<S>((from[l] - origin) / unit);
  } else {
    for (int l = 0; l < count; ++l) x[l] = static_cast<S>((from[l] - origin) / unit);
  }
  return x;
}

/// Symmetric 3 x 3 matrices.
template <class S>
struct Symmetric {
  Value<S> xx{}, xy{}, xz{}, yy{}, yz{}, zz{};

  MVS_INLINE void AddOuter(const Value<S>& weight, const Value<S>& x, const Value<S>& y, const Value<S>& z) {
    const Value<S> wx = weight * x, wy = weight * y;
    xx += wx * x, xy += wx * y, xz += wx * z;
    yy += wy * y, yz += wy * z, zz += weight * z * z;
  }
  MVS_INLINE Value<S> Trace() const { return xx + yy + zz; }
};

template <class S>
struct Inverse {
  Symmetric<S> matrix;
  Value<S> determinant;
};

template <class S>
MVS_INLINE Inverse<S> Invert(const Symmetric<S>& m) {
  Inverse<S> result;
  Symmetric<S>& i = result.matrix;
  i.xx = m.yy * m.zz - m.yz * m.yz;
  i.xy = m.xz * m.yz - m.xy * m.zz;
  i.xz = m.xy * m.yz - m.xz * m.yy;
  i.yy = m.xx * m.zz - m.xz * m.xz;
  i.yz = m.xy * m.xz - m.xx * m.yz;
  i.zz = m.xx * m.yy - m.xy * m.xy;
  result.determinant = m.xx * i.xx + m.xy * i.xy + m.xz * i.xz;
  const Value<S> scale = S(1) / result.determinant;
  i.xx *= scale, i.xy *= scale, i.xz *= scale, i.yy *= scale, i.yz *= scale, i.zz *= scale;
  return result;
}

template <class S>
struct Vec3 {
  Value<S> x{}, y{}, z{};
};

template <class S>
MVS_INLINE Vec3<S> Apply(const Symmetric<S>& m, const Vec3<S>& v) {
  return {m.xx * v.x + m.xy * v.y + m.xz * v.z, m.xy * v.x + m.yy * v.y + m.yz * v.z, m.xz * v.x + m.yz * v.y + m.zz * v.z};
}

template <class S>
MVS_INLINE Value<S> Dot(const Vec3<S>& u, const Vec3<S>& v) {
  return u.x * v.x + u.y * v.y + u.z * v.z;
}

}  // namespace mvstudio::triangulate::internal
