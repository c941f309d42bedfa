#include "avatar/splats/gradients.h"

#include "avatar/splats/splat_view.h"
#include "core/check.h"
#include "core/parallel.h"

namespace mvstudio::splats {
namespace {

/// Derivatives of the loss by what the projection computes on the way.
template <class S>
struct Chain {
  S xx = 0, xy = 0, yy = 0, log_kept = 0;
  Vec3<S> mean_in_cam = Vec3<S>::Zero(), mean = Vec3<S>::Zero();
};

/// Inverse covariance and opacity -> covariance before the filter.
template <class S>
void ToCovariance(const SplatView<S>& s, const Splat<S>& at, const SplatGradient<S>& g, bool mip, Chain<S>* d) {
  const S a = at.a, b = at.b, c = at.c;
  d->xx = -(a * a * g.a + a * b * g.b + b * b * g.c);
  d->yy = -(b * b * g.a + b * c * g.b + c * c * g.c);
  d->xy = -(2 * a * b * g.a + (a * c + b * b) * g.b + 2 * b * c * g.c);
  d->log_kept = g.opacity * at.opacity;
  if (!mip) return;
  d->xx += d->log_kept * S(0.5) * (s.yy / s.det - a);
  d->yy += d->log_kept * S(0.5) * (s.xx / s.det - c);
  d->xy -= d->log_kept * (s.xy / s.det + b);
}

/// Covariance -> scales, rotation, and the place where the projection is linearised.
template <class S>
void ToShape(const SplatView<S>& s, const PinholeView<S>& view, size_t i, const BasicCloud<S>& cloud, Chain<S>* d,
             Parameters<S>* out) {
  const Vec3<S> row0 = s.image_from_own.row(0).transpose(), row1 = s.image_from_own.row(1).transpose();
  const Vec3<S> a = row0.cwiseProduct(s.scale), b = row1.cwiseProduct(s.scale);
  const Vec3<S> by_a = 2 * d->xx * a + d->xy * b, by_b = 2 * d->yy * b + d->xy * a;
  const Vec3<S> by_scale = by_a.cwiseProduct(row0) + by_b.cwiseProduct(row1);
  for (int k = 0; k < 3; ++k) {
    const size_t at = 3 * i + static_cast<size_t>(k);
    const S log_scale = cloud.values.log_scale[at];
    if (log_scale < S(kLeastLogScale) || log_scale > S(kMostLogScale)) continue;
    const S share = s.variance[k] / (s.scale[k] * s.scale[k]);
    out->log_scale[at] += by_scale[k] * s.scale[k] * share + d->log_kept * (1 - share);
  }
  const Vec3<S> by_row0 = by_a.cwiseProduct(s.scale), by_row1 = by_b.cwiseProduct(s.scale);
  const S z = s.mean_in_cam[2], px = view.fx / z, py = view.fy / z;
  const Mat3<S> cam_from_own = s.cam_from_face * s.face_from_own;
  Mat3<S> by_cam_from_own;
  by_cam_from_own.row(0) = px * by_row0.transpose();
  by_cam_from_own.row(1) = py * by_row1.transpose();
  by_cam_from_own.row(2) = -(px * s.u * by_row0 + py * s.v * by_row1).transpose();
  const Mat3<S> by_rotation = s.cam_from_face.transpose() * by_cam_from_own;
  const Eigen::Matrix<S, 4, 1> by_unit = QuaternionGradient(s.quaternion, by_rotation);
  const Eigen::Matrix<S, 4, 1> by_quaternion = (by_unit - s.quaternion * s.quaternion.dot(by_unit)) / s.quaternion_norm;
  for (int k = 0; k < 4; ++k) out->rotation[4 * i + static_cast<size_t>(k)] += by_quaternion[k];
  const S by_u = s.u_free ? -px * cam_from_own.row(2).dot(by_row0) : S(0);
  const S by_v = s.v_free ? -py * cam_from_own.row(2).dot(by_row1) : S(0);
  d->mean_in_cam[0] += by_u / z, d->mean_in_cam[1] += by_v / z;
  d->mean_in_cam[2] -= (by_u * s.mean_in_cam[0] / z + by_v * s.mean_in_cam[1] / z + row0.dot(by_row0) + row1.dot(by_row1)) / z;
}

/// Colour -> coefficients, and the mean by way of the direction of sight.
template <class S>
void ToColour(const SplatView<S>& s, const SplatGradient<S>& g, size_t i, const BasicCloud<S>& cloud, Chain<S>* d,
              Parameters<S>* out) {
  const int degree = cloud.values.degree, n = BasisSize(degree);
  const size_t at = i * static_cast<size_t>(3 * n);
  S by_rgb[3], slope[3 * BasisSize(kMaxDegree)];
  for (int c = 0; c < 3; ++c) by_rgb[c] = s.rgb[c] > 0 ? g.rgb[c] : S(0);
  for (int k = 0; k < n; ++k)
    for (int c = 0; c < 3; ++c) out->colour[at + static_cast<size_t>(3 * k + c)] += s.basis[k] * by_rgb[c];
  if (degree == 0) return;
  EvaluateBasisGradient<S>(s.direction, degree, slope);
  Vec3<S> by_direction = Vec3<S>::Zero();
  for (int k = 1; k < n; ++k) {
    S by_basis = 0;
    for (int c = 0; c < 3; ++c) by_basis += cloud.values.colour[at + static_cast<size_t>(3 * k + c)] * by_rgb[c];
    by_direction += by_basis * Vec3<S>(slope[3 * k], slope[3 * k + 1], slope[3 * k + 2]);
  }
  const Vec3<S> across = by_direction - s.direction * s.direction.dot(by_direction);
  d->mean += s.placed.world_from_face * (across / s.distance);
}

template <class S>
void AddOne(const BasicCloud<S>& cloud, size_t i, const Surface<S>& surface, const PinholeView<S>& view,
            const RenderSettings& settings, const Splat<S>& splat, const SplatGradient<S>& g, Parameters<S>* out) {
  const SplatView<S> s = SeeSplat(cloud, i, surface, view, settings);
  Chain<S> d;
  ToCovariance(s, splat, g, settings.mip, &d);
  out->opacity[i] += d.log_kept * (1 - s.sigmoid);
  const S z = s.mean_in_cam[2], px = view.fx / z, py = view.fy / z;
  d.mean_in_cam = Vec3<S>(g.x * px, g.y * py, -(g.x * px * s.mean_in_cam[0] + g.y * py * s.mean_in_cam[1]) / z);
  ToShape(s, view, i, cloud, &d, out);
  ToColour(s, g, i, cloud, &d, out);
  d.mean += view.cam_from_world.transpose() * d.mean_in_cam;
  out->place[2 * i] += d.mean.dot(s.placed.edge1), out->place[2 * i + 1] += d.mean.dot(s.placed.edge2);
  out->offset[i] += d.mean.dot(Vec3<S>(s.placed.world_from_face.col(2)));
}

}  // namespace

template <class S>
void AddGradients(const BasicCloud<S>& cloud, const Surface<S>& surface, const PinholeView<S>& view,
                  const RenderSettings& settings, const std::vector<Splat<S>>& splats,
                  const std::vector<SplatGradient<S>>& gradients, Parameters<S>* out, std::vector<S>* view_space) {
  MVS_CHECK(out->size() == cloud.size() && out->degree == cloud.values.degree, "gradients of another cloud");
  MVS_CHECK(gradients.size() == splats.size(), gradients.size() << " gradients of " << splats.size() << " splats");
  constexpr int64_t kChunk = 1024;
  const auto n = static_cast<int64_t>(splats.size());
  ParallelFor((n + kChunk - 1) / kChunk, settings.num_threads, [&](int64_t chunk) {
    for (int64_t k = chunk * kChunk; k < std::min(n, (chunk + 1) * kChunk); ++k) {
      const SplatGradient<S>& g = gradients[static_cast<size_t>(k)];
      const Splat<S>& splat = splats[static_cast<size_t>(k)];
      const auto i = static_cast<size_t>(splat.index);
      AddOne(cloud, i, surface, view, settings, splat, g, out);
      if (view_space) (*view_space)[i] += std::sqrt(g.x * g.x + g.y * g.y);
    }
  });
}

template void AddGradients(const BasicCloud<float>&, const Surface<float>&, const PinholeView<float>&, const RenderSettings&,
                           const std::vector<Splat<float>>&, const std::vector<SplatGradient<float>>&, Parameters<float>*,
                           std::vector<float>*);
template void AddGradients(const BasicCloud<double>&, const Surface<double>&, const PinholeView<double>&, const RenderSettings&,
                           const std::vector<Splat<double>>&, const std::vector<SplatGradient<double>>&, Parameters<double>*,
                           std::vector<double>*);

}  // namespace mvstudio::splats
