#include "avatar/camera_tensor.h"

#include <ATen/ATen.h>

#include <limits>
#include <map>
#include <vector>

#include "core/check.h"
#include "core/error.h"

namespace mvstudio::avatar {
namespace {

int64_t NumDistortion(const std::string& lens_model) {
  static const std::map<std::string, int64_t> counts = {{"pinhole", 0}, {"brown1", 1},    {"brown2", 2},  {"brown4", 4},
                                                        {"brown5", 5},  {"rational8", 8}, {"kannala4", 4}};
  const auto found = counts.find(lens_model);
  if (found == counts.end()) {
    throw UsageError("lens model '" + lens_model +
                     "' is unknown; one of pinhole, brown1, brown2, brown4, brown5, rational8, kannala4");
  }
  return found->second;
}

/// The model's k1, k2, p1, p2, k3, k4, k5, k6, zeros where it has none.
std::vector<at::Tensor> Distortion(const at::Tensor& params, int64_t count) {
  std::vector<at::Tensor> k;
  for (int64_t i = 0; i < 8; ++i) k.push_back(i < count ? params.select(-1, 4 + i) : at::zeros_like(params.select(-1, 0)));
  return k;
}

std::pair<at::Tensor, at::Tensor> Brown(const std::vector<at::Tensor>& k, bool rational, const at::Tensor& a,
                                        const at::Tensor& b) {
  const at::Tensor r2 = a * a + b * b;
  at::Tensor radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  if (rational) radial = radial / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  return {a * radial + 2 * k[2] * a * b + k[3] * (r2 + 2 * a * a), b * radial + k[2] * (r2 + 2 * b * b) + 2 * k[3] * a * b};
}

std::pair<at::Tensor, at::Tensor> Kannala(const std::vector<at::Tensor>& k, const at::Tensor& x, const at::Tensor& y,
                                          const at::Tensor& z) {
  const at::Tensor s2 = x * x + y * y;
  const at::Tensor on_axis = s2 <= 0;
  const at::Tensor s = at::sqrt(at::where(on_axis, at::ones_like(s2), s2));
  const at::Tensor theta = at::atan2(s, z), t2 = theta * theta;
  const at::Tensor radius = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
  const at::Tensor scale = at::where(on_axis, 1 / z, radius / s);
  return {x * scale, y * scale};
}

}  // namespace

at::Tensor ProjectTensor(const std::string& lens_model, const at::Tensor& params, const at::Tensor& x_in_cam) {
  const int64_t count = NumDistortion(lens_model);
  MVS_CHECK(params.size(-1) == 4 + count, lens_model << " has " << 4 + count << " parameters, not " << params.size(-1));
  MVS_CHECK(x_in_cam.size(-1) == 3, "points must be (..., 3)");
  const at::Tensor x = x_in_cam.select(-1, 0), y = x_in_cam.select(-1, 1), z = x_in_cam.select(-1, 2);
  const std::vector<at::Tensor> k = Distortion(params, count);
  const bool fisheye = lens_model == "kannala4";
  const auto [a, b] = fisheye ? Kannala(k, x, y, z) : Brown(k, lens_model == "rational8", x / z, y / z);
  const at::Tensor defined = fisheye ? (z > 0).logical_or(x * x + y * y > 0) : z > 0;
  const at::Tensor px =
      at::stack({params.select(-1, 0) * a + params.select(-1, 2), params.select(-1, 1) * b + params.select(-1, 3)}, -1);
  return px.masked_fill(defined.logical_not().expand_as(px.select(-1, 0)).unsqueeze(-1),
                        std::numeric_limits<double>::quiet_NaN());
}

at::Tensor ProjectPinhole(const at::Tensor& intrinsics, const at::Tensor& x_in_cam) {
  return ProjectTensor("pinhole", intrinsics.unsqueeze(1), x_in_cam);
}

}  // namespace mvstudio::avatar
