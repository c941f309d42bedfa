#include "avatar/splats/train/initial.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "avatar/splats/colour.h"
#include "core/check.h"
#include "core/random.h"

namespace mvstudio::splats {
namespace {

double AreaOf(const body::BodyTemplate& body, Eigen::Index face) {
  const Eigen::Vector3d x0 = body.vertices.col(body.faces(0, face)).cast<double>(),
                        x1 = body.vertices.col(body.faces(1, face)).cast<double>(),
                        x2 = body.vertices.col(body.faces(2, face)).cast<double>();
  const double area = 0.5 * (x1 - x0).cross(x2 - x0).norm();
  return std::isfinite(area) ? area : 0;
}

/// The texel at a place of a face, R, G, B in [0, 1].
Eigen::Vector3f ColourAt(const body::BodyTemplate& body, const body::Textures& textures, Eigen::Index face, float w1,
                         float w2) {
  const Eigen::Vector2f uv =
      (1 - w1 - w2) * body.face_uv.col(3 * face) + w1 * body.face_uv.col(3 * face + 1) + w2 * body.face_uv.col(3 * face + 2);
  const Image& texture = textures[static_cast<size_t>(body.face_part[static_cast<size_t>(face)] - 1)];
  const int x = std::clamp(static_cast<int>(uv[0] * static_cast<float>(texture.width)), 0, texture.width - 1),
            y = std::clamp(static_cast<int>(uv[1] * static_cast<float>(texture.height)), 0, texture.height - 1);
  const uint8_t* texel = texture.Pixel(x, y);
  return Eigen::Vector3f(texel[0], texel[1], texel[2]) / 255;
}

void Add(const body::BodyTemplate& body, const body::Textures& textures, Eigen::Index face, float log_scale, Rng* rng, size_t i,
         Cloud* cloud) {
  constexpr float kLogitOfMost = 3;      // 0.95
  constexpr float kFlat = -0.91629073f;  // two fifths as thick as wide
  constexpr float kSunk = 1;             // widths below the surface: the outline is then about the body's
  double w1 = rng->Uniform(), w2 = rng->Uniform();
  if (w1 + w2 > 1) w1 = 1 - w1, w2 = 1 - w2;
  Parameters<float>& v = cloud->values;
  cloud->face[i] = static_cast<int>(face);
  v.place[2 * i] = static_cast<float>(w1), v.place[2 * i + 1] = static_cast<float>(w2);
  for (size_t k = 0; k < 3; ++k) v.log_scale[3 * i + k] = k < 2 ? log_scale : log_scale + kFlat;
  v.rotation[4 * i + 3] = 1;
  v.opacity[i] = kLogitOfMost;
  v.offset[i] = -kSunk * std::exp(log_scale);
  const Eigen::Vector3f colour = ColourAt(body, textures, face, static_cast<float>(w1), static_cast<float>(w2));
  const size_t at = i * static_cast<size_t>(3 * BasisSize(v.degree));
  for (int c = 0; c < 3; ++c) v.colour[at + static_cast<size_t>(c)] = (colour[c] - 0.5f) / static_cast<float>(kBasis0);
}

}  // namespace

double SurfaceArea(const body::BodyTemplate& body) {
  double area = 0;
  for (Eigen::Index face = 0; face < body.faces.cols(); ++face) area += AreaOf(body, face);
  return area;
}

Cloud CoverBody(const body::BodyTemplate& body, const body::Textures& textures, int64_t count, int degree, uint64_t seed) {
  constexpr double kWide = 0.7;  // standard deviation over the root of the area that a Gaussian covers: few holes between them
  MVS_CHECK(degree >= 0 && degree <= kMaxDegree, "degree " << degree);
  const double area = SurfaceArea(body);
  MVS_CHECK(count > 0 && area > 0, count << " Gaussians on " << area << " m^2");
  Cloud cloud;
  const auto n = static_cast<size_t>(count);
  cloud.face.assign(n, 0);
  cloud.filter_variance.assign(n, 0.f);
  cloud.values = ZeroParameters<float>(n, degree);
  const auto log_scale = static_cast<float>(std::log(kWide * std::sqrt(area / static_cast<double>(count))));
  Rng rng(seed);
  const double shift = rng.Uniform();
  double passed = 0;  // area of the faces so far, in units of one Gaussian's share
  size_t i = 0;
  Eigen::Index last = 0;
  for (Eigen::Index face = 0; face < body.faces.cols(); ++face) {
    const double share = AreaOf(body, face) / area * static_cast<double>(count);
    if (share > 0) last = face;
    passed += share;
    for (; i < n && static_cast<double>(i) + shift < passed; ++i) Add(body, textures, face, log_scale, &rng, i, &cloud);
  }
  for (; i < n; ++i) Add(body, textures, last, log_scale, &rng, i, &cloud);  // rounding may leave the last one
  return cloud;
}

}  // namespace mvstudio::splats
