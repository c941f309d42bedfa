#pragma once

#include <optional>
#include <string_view>
#include <type_traits>

#include "geometry/lens/models/brown1.h"
#include "geometry/lens/models/brown1_p.h"
#include "geometry/lens/models/brown2.h"
#include "geometry/lens/models/brown4.h"
#include "geometry/lens/models/brown5.h"
#include "geometry/lens/models/doublesphere.h"
#include "geometry/lens/models/eucm.h"
#include "geometry/lens/models/kannala4.h"
#include "geometry/lens/models/lens_param.h"
#include "geometry/lens/models/pinhole.h"
#include "geometry/lens/models/rational8.h"
#include "geometry/lens/models/splined.h"
#include "geometry/lens/models/thinprism12.h"
#include "geometry/lens/models/ucm.h"

/// The list of lens models. To add one:
///   1. write geometry/lens/models/NAME.h, with a struct as described here;
///   2. name it in this file, among the includes and in MVS_LENS_MODELS.
/// Everything else asks the struct, or LensTraits. `k` are the distortion parameters, those after fx, fy, cx, cy; formulas give
/// points (a', b') of the image plane, of which the pixel is u = fx a' + cx, v = fy b' + cy.
///
/// Every struct has these members (those in brackets have defaults, in lens_base.h):
///   kName, kParams         its name in files, and its parameters' names, ordinary values and limits (lens_param.h)
///   [Simpler]              the struct of the model with fewer terms that is tried where boards do not determine this one
///   [kWide]                sees points 90 degrees and more off the axis; radii are theta instead of tan(theta)
///   [kOpenCv]              a special case of OpenCV's perspective lens: the names of its parameters tell which
///   Project<T>             the formula, over any scalar: the program's, in double, and that of the tests, in 60 digits
///   ProjectWithDerivatives the same with closed-form derivatives
///   Radial, FirstFold, [LargestRadius], [InvertRadial]   the radial function, where it ends, and its inverse
///   [AxisScale]            px a radian on the axis are f / AxisScale(k)
///   [FitStarts], [Basins]  where fits start from, and the middles of several minima that an adjustment may fall into
/// Bases that provide most of it: Perspective (perspective.h) from Distort, Slopes and ByParams; Brown (brown.h); Sphere
/// (sphere.h) from the denominator of (x, y) / D; Decentred (decentred.h) from another model.
/// A perspective model whose Distort and Slopes use more than + - * / sets kArithmetic to false: vectors cannot do it.
/// Functions that fill in derivatives are templates over where these go, so that reading this file is cheap.
// clang-format off
#define MVS_LENS_MODELS(X) \
  X(Pinhole)         /* pinhole */                                                           \
  X(Brown1)          /* brown1: k1 */                                                        \
  X(Brown2)          /* brown2: k1, k2 */                                                    \
  X(Brown4)          /* brown4: k1, k2, p1, p2 */                                            \
  X(Brown5)          /* brown5: k1, k2, p1, p2, k3 */                                        \
  X(Rational8)       /* rational8: k1, k2, p1, p2, k3, k4, k5, k6 */                         \
  X(KannalaBrandt4)  /* kannala4: k1, k2, k3, k4 */                                          \
  X(ThinPrism12)     /* thinprism12: k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 */       \
  X(Ucm)             /* ucm: xi */                                                           \
  X(Eucm)            /* eucm: alpha, beta */                                                 \
  X(DoubleSphere)    /* doublesphere: xi, alpha */                                           \
  X(PinholeP)        /* pinhole_p: p1, p2 */                                                 \
  X(Brown1P)         /* brown1_p: k1, p1, p2 */                                              \
  X(KannalaBrandt4P) /* kannala4_p: k1, k2, k3, k4, p1, p2 */                                \
  X(UcmP)            /* ucm_p: xi, p1, p2 */                                                 \
  X(EucmP)           /* eucm_p: alpha, beta, p1, p2 */                                       \
  X(DoubleSphereP)   /* doublesphere_p: xi, alpha, p1, p2 */                                 \
  X(Splined)         /* splined: control points du_x, du_y of Camera::spline, row by row */
// clang-format on

namespace mvstudio::geometry {

/// Central lens models, "k" and the name of the struct. The formula of each stands in its header; Camera::params start with fx,
/// fy, cx, cy (px). A name ending in "_p" is the model with decentring p1, p2 added at the end. The splined model, whose number
/// of parameters depends on its grid, comes last.
enum class LensModel {
#define MVS_ENUMERATOR(Name) k##Name,
  MVS_LENS_MODELS(MVS_ENUMERATOR)
#undef MVS_ENUMERATOR
};

inline constexpr LensModel kAllLensModels[] = {
#define MVS_ENUMERATOR(Name) LensModel::k##Name,
    MVS_LENS_MODELS(MVS_ENUMERATOR)
#undef MVS_ENUMERATOR
};

/// What is asked of a model where its formula does not matter; see above.
struct LensTraits {
  std::string_view name;
  const LensParam* params = nullptr;  ///< num_params of them, in the order of Camera::params, without fx, fy, cx, cy
  int num_params = 0;                 ///< 0 for models with a grid
  bool wide = false, has_grid = false, opencv = false, arithmetic = false;
  bool radial_terms = false;  ///< it has other terms than decentring
  int decentring = -1;        ///< index in `params` of p1, which p2 follows
  std::optional<LensModel> simpler;
};

namespace internal {

template <class Lens>
inline constexpr std::optional<LensModel> kModelOf = std::nullopt;
#define MVS_MODEL_OF(Name) \
  template <>              \
  inline constexpr std::optional<LensModel> kModelOf<Name> = LensModel::k##Name;
MVS_LENS_MODELS(MVS_MODEL_OF)
#undef MVS_MODEL_OF

template <class Lens>
constexpr LensTraits MakeTraits() {
  static_assert(std::is_void_v<typename Lens::Simpler> || kModelOf<typename Lens::Simpler>.has_value());
  LensTraits traits;
  traits.name = Lens::kName;
  traits.params = Lens::kParams.data(), traits.num_params = static_cast<int>(Lens::kParams.size());
  traits.wide = Lens::kWide, traits.has_grid = Lens::kHasGrid, traits.opencv = Lens::kOpenCv;
  traits.arithmetic = Lens::kArithmetic;
  traits.simpler = kModelOf<typename Lens::Simpler>;
  for (int i = traits.num_params - 1; i >= 0; --i) {
    if (traits.params[i].role == LensRole::kDecentring) traits.decentring = i;
    if (traits.params[i].role != LensRole::kDecentring) traits.radial_terms = true;
  }
  return traits;
}

inline constexpr LensTraits kLensTraits[] = {
#define MVS_TRAITS(Name) MakeTraits<Name>(),
    MVS_LENS_MODELS(MVS_TRAITS)
#undef MVS_TRAITS
};

[[noreturn]] void NoSuchLensModel(LensModel model);

template <class Lens>
Lens MakeLens(const SplineGrid& grid) {
  if constexpr (Lens::kHasGrid) {
    return Lens(grid);
  } else {
    return Lens();
  }
}

/// `visit` with the struct of the model. The grid is used by the splined model only and must outlive the visit.
template <class Visit>
decltype(auto) VisitLens(LensModel model, const SplineGrid& grid, Visit&& visit) {
  switch (model) {
#define MVS_CASE(Name)     \
  case LensModel::k##Name: \
    return visit(MakeLens<Name>(grid));
    MVS_LENS_MODELS(MVS_CASE)
#undef MVS_CASE
  }
  NoSuchLensModel(model);
}

}  // namespace internal

constexpr const LensTraits& TraitsOf(LensModel model) { return internal::kLensTraits[static_cast<int>(model)]; }

}  // namespace mvstudio::geometry
