#include "avatar/maps/camera_tensor.h"

#include <ATen/ATen.h>

#include <limits>
#include <map>
#include <vector>

#include "core/check.h"
#include "core/error.h"
#include "core/join.h"

namespace mvstudio::avatar {
namespace {

using TensorPair = std::pair<at::Tensor, at::Tensor>;

/// A model's radial function and what stands on top of it.
struct Lens {
  enum Family { kBrown, kKannala, kUcm, kEucm, kDoubleSphere } family;
  int64_t count;   ///< distortion parameters
  bool decentred;  ///< p1, p2 come last and act on the image plane of the radial part; Brown's own stand in OpenCV's order
};

const Lens& LensOf(const std::string& lens_model) {
  static const std::map<std::string, Lens> lenses = {{"pinhole", {Lens::kBrown, 0, false}},
                                                     {"brown1", {Lens::kBrown, 1, false}},
                                                     {"brown2", {Lens::kBrown, 2, false}},
                                                     {"brown4", {Lens::kBrown, 4, false}},
                                                     {"brown5", {Lens::kBrown, 5, false}},
                                                     {"rational8", {Lens::kBrown, 8, false}},
                                                     {"thinprism12", {Lens::kBrown, 12, false}},
                                                     {"pinhole_p", {Lens::kBrown, 2, true}},
                                                     {"brown1_p", {Lens::kBrown, 3, true}},
                                                     {"kannala4", {Lens::kKannala, 4, false}},
                                                     {"kannala4_p", {Lens::kKannala, 6, true}},
                                                     {"ucm", {Lens::kUcm, 1, false}},
                                                     {"ucm_p", {Lens::kUcm, 3, true}},
                                                     {"eucm", {Lens::kEucm, 2, false}},
                                                     {"eucm_p", {Lens::kEucm, 4, true}},
                                                     {"doublesphere", {Lens::kDoubleSphere, 2, false}},
                                                     {"doublesphere_p", {Lens::kDoubleSphere, 4, true}}};
  const auto found = lenses.find(lens_model);
  if (found != lenses.end()) return found->second;
  if (lens_model == "splined") {
    throw UsageError("splined lenses have no projection over tensors: undistort the images to a pinhole first");
  }
  throw UsageError("lens model '" + lens_model + "' is unknown; one of " +
                   Join(lenses, ", ", [](const auto& lens) { return lens.first; }));
}

/// k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 of a perspective model, zeros where it has none.
std::vector<at::Tensor> BrownTerms(const Lens& lens, const at::Tensor& params) {
  std::vector<at::Tensor> k(12, at::zeros_like(params.select(-1, 0)));
  const int64_t radial = lens.decentred ? lens.count - 2 : lens.count;
  for (int64_t i = 0; i < radial; ++i) k[i] = params.select(-1, 4 + i);
  if (lens.decentred) k[2] = params.select(-1, 4 + radial), k[3] = params.select(-1, 5 + radial);
  return k;
}

/// What Brown's p1, p2 add to (a, b).
TensorPair Decentring(const at::Tensor& p1, const at::Tensor& p2, const at::Tensor& a, const at::Tensor& b) {
  const at::Tensor r2 = a * a + b * b;
  return {2 * p1 * a * b + p2 * (r2 + 2 * a * a), p1 * (r2 + 2 * b * b) + 2 * p2 * a * b};
}

TensorPair Brown(const std::vector<at::Tensor>& k, const at::Tensor& a, const at::Tensor& b) {
  const at::Tensor r2 = a * a + b * b;
  const at::Tensor radial = (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  const auto [da, db] = Decentring(k[2], k[3], a, b);
  return {a * radial + da + r2 * (k[8] + r2 * k[9]), b * radial + db + r2 * (k[10] + r2 * k[11])};
}

/// 1 / D of the wide models; NaN where it is undefined.
at::Tensor WideScale(const Lens& lens, const at::Tensor& params, const at::Tensor& s2, const at::Tensor& z) {
  const auto k = [&](int64_t i) { return params.select(-1, 4 + i); };
  const at::Tensor nan = at::full_like(s2, std::numeric_limits<double>::quiet_NaN());
  if (lens.family == Lens::kKannala) {
    const at::Tensor on_axis = s2 <= 0;
    const at::Tensor s = at::sqrt(at::where(on_axis, at::ones_like(s2), s2));
    const at::Tensor theta = at::atan2(s, z), t2 = theta * theta;
    const at::Tensor radius = theta * (1 + t2 * (k(0) + t2 * (k(1) + t2 * (k(2) + t2 * k(3)))));
    return at::where(on_axis.logical_and(z <= 0), nan, at::where(on_axis, 1 / z, radius / s));
  }
  const at::Tensor square = (lens.family == Lens::kEucm ? k(1) * s2 : s2) + z * z;
  const at::Tensor d = at::sqrt(at::where(square > 0, square, nan));
  at::Tensor denominator = lens.family == Lens::kEucm ? k(0) * d + (1 - k(0)) * z : z + k(0) * d;
  if (lens.family == Lens::kDoubleSphere) {
    denominator = k(1) * at::sqrt(s2 + denominator * denominator) + (1 - k(1)) * denominator;
  }
  return 1 / at::where(denominator > 0, denominator, at::full_like(denominator, std::numeric_limits<double>::quiet_NaN()));
}

TensorPair Wide(const Lens& lens, const at::Tensor& params, const at::Tensor& x, const at::Tensor& y, const at::Tensor& z) {
  const at::Tensor scale = WideScale(lens, params, x * x + y * y, z), a = x * scale, b = y * scale;
  if (!lens.decentred) return {a, b};
  const auto [da, db] = Decentring(params.select(-1, 2 + lens.count), params.select(-1, 3 + lens.count), a, b);
  return {a + da, b + db};
}

}  // namespace

at::Tensor ProjectTensor(const std::string& lens_model, const at::Tensor& params, const at::Tensor& x_in_cam) {
  const Lens& lens = LensOf(lens_model);
  MVS_CHECK(params.size(-1) == 4 + lens.count,
            lens_model << " has " << 4 + lens.count << " parameters, not " << params.size(-1));
  MVS_CHECK(x_in_cam.size(-1) == 3, "points must be (..., 3)");
  const at::Tensor x = x_in_cam.select(-1, 0), y = x_in_cam.select(-1, 1), z = x_in_cam.select(-1, 2);
  const bool perspective = lens.family == Lens::kBrown;
  const auto [a, b] = perspective ? Brown(BrownTerms(lens, params), x / z, y / z) : Wide(lens, params, x, y, z);
  const at::Tensor defined = perspective ? z > 0 : at::isfinite(a).logical_and(at::isfinite(b));
  const at::Tensor px =
      at::stack({params.select(-1, 0) * a + params.select(-1, 2), params.select(-1, 1) * b + params.select(-1, 3)}, -1);
  return px.masked_fill(defined.logical_not().expand_as(px.select(-1, 0)).unsqueeze(-1),
                        std::numeric_limits<double>::quiet_NaN());
}

at::Tensor ProjectPinhole(const at::Tensor& intrinsics, const at::Tensor& x_in_cam) {
  return ProjectTensor("pinhole", intrinsics.unsqueeze(1), x_in_cam);
}

}  // namespace mvstudio::avatar
