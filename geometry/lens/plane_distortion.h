#pragma once

#include "geometry/lens/models.h"

namespace mvstudio::geometry {

/// Distorted image-plane coordinates and their derivatives by the undistorted ones. T may be a vector of the compiler's, whose
/// own alignment depends on the instruction set.
template <class T>
struct alignas(sizeof(T)) PlaneDistortion {
  T a, b, a_by_a, a_by_b, b_by_a, b_by_b;
};

/// The most distortion parameters that a model of DistortPlane has.
constexpr int MaxPlaneParams() {
  int most = 0;
  for (const LensTraits& traits : internal::kLensTraits) {
    if (traits.arithmetic && traits.num_params > most) most = traits.num_params;
  }
  return most;
}

namespace internal {

template <class Lens, class S, class T>
[[gnu::always_inline]] inline PlaneDistortion<T> DistortPlane(const S* k, const T& a, const T& b) {
  static_assert(!Lens::kArithmetic || !Lens::kWide);
  if constexpr (Lens::kArithmetic) {
    PlaneDistortion<T> m;
    Lens::Distort(k, a, b, &m.a, &m.b);
    const PlaneSlopes<T> slopes = Lens::Slopes(k, a, b);
    m.a_by_a = slopes.a_by_a, m.a_by_b = slopes.a_by_b, m.b_by_a = slopes.b_by_a, m.b_by_b = slopes.b_by_b;
    return m;
  } else {
    NoSuchLensModel(*kModelOf<Lens>);
  }
}

}  // namespace internal

/// The formula of a perspective model on the image plane with its derivatives, for plain numbers and for vectors of them; `k`
/// are the distortion parameters, of T's element type. Only for models that are `arithmetic`.
template <class S, class T>
[[gnu::always_inline]] inline PlaneDistortion<T> DistortPlane(LensModel model, const S* k, const T& a, const T& b) {
  switch (model) {
#define MVS_CASE(Name)     \
  case LensModel::k##Name: \
    return internal::DistortPlane<internal::Name>(k, a, b);
    MVS_LENS_MODELS(MVS_CASE)
#undef MVS_CASE
  }
  internal::NoSuchLensModel(model);
}

}  // namespace mvstudio::geometry
