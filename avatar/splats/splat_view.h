// Private: one Gaussian as a camera sees it, with what its derivatives need, for project.cc and gradients.cc.
#pragma once

#include <algorithm>
#include <cmath>

#include "avatar/splats/colour.h"
#include "avatar/splats/place.h"

namespace mvstudio::splats {

template <class S>
struct SplatView {
  Status status = Status::kOk;
  Placed<S> placed;
  Vec3<S> mean_in_cam;
  S u, v;                             // x / z and y / z where the projection is linearised
  bool u_free, v_free;                // they are those of the mean
  Eigen::Matrix<S, 4, 1> quaternion;  // unit
  S quaternion_norm;
  Mat3<S> face_from_own, cam_from_face;
  Vec3<S> variance, scale;                // squared standard deviations as learned; standard deviations after the 3D filter
  Eigen::Matrix<S, 2, 3> image_from_own;  // derivative of the pixel by own coordinates, px / m
  S xx, xy, yy;                           // covariance in the image before the 2D filter, px^2
  S det, filtered_det;                    // of it, and after
  S low_pass;                             // variance added, px^2
  S sigmoid, kept;                        // opacity as learned; share of it that the filters keep
  Vec3<S> direction;                      // of sight, unit, in face
  S distance;                             // metres
  S basis[BasisSize(kMaxDegree)];
  S rgb[3];  // before clamping
};

/// Logarithms of scales beyond these have no effect: exp would underflow or overflow.
inline constexpr double kLeastLogScale = -14, kMostLogScale = 5;

template <class S>
S Scale(S log_scale) {
  return std::exp(std::min(std::max(log_scale, S(kLeastLogScale)), S(kMostLogScale)));
}

/// Scales and their 3D smoothing filter: Yu et al., 2024, equation 9, for a diagonal covariance.
template <class S>
void SmoothScales(const BasicCloud<S>& cloud, size_t i, SplatView<S>* s) {
  S learned = 1, smoothed = 1;
  for (int k = 0; k < 3; ++k) {
    const S scale = Scale(cloud.values.log_scale[3 * i + static_cast<size_t>(k)]);
    s->variance[k] = scale * scale;
    s->scale[k] = std::sqrt(s->variance[k] + cloud.filter_variance[i]);
    learned *= scale, smoothed *= s->scale[k];
  }
  s->kept = learned / smoothed;
}

/// The projection linearised at the mean, and the covariance that it gives.
template <class S>
void LinearProjection(const PinholeView<S>& view, SplatView<S>* s) {
  const S z = s->mean_in_cam[2], x = s->mean_in_cam[0] / z, y = s->mean_in_cam[1] / z;
  s->u = std::min(std::max(x, view.low_x), view.high_x), s->v = std::min(std::max(y, view.low_y), view.high_y);
  s->u_free = s->u == x, s->v_free = s->v == y;
  s->cam_from_face = view.cam_from_world * s->placed.world_from_face;
  const Mat3<S> cam_from_own = s->cam_from_face * s->face_from_own;
  const S px = view.fx / z, py = view.fy / z;
  s->image_from_own.row(0) = px * (cam_from_own.row(0) - s->u * cam_from_own.row(2));
  s->image_from_own.row(1) = py * (cam_from_own.row(1) - s->v * cam_from_own.row(2));
  const Vec3<S> a = s->image_from_own.row(0).transpose().cwiseProduct(s->scale),
                b = s->image_from_own.row(1).transpose().cwiseProduct(s->scale);
  s->xx = a.squaredNorm(), s->xy = a.dot(b), s->yy = b.squaredNorm();
  s->det = a.cross(b).squaredNorm();  // xx yy - xy^2, without its cancellation
}

/// The 2D filter; without it the covariance alone grows.
template <class S>
void LowPass(const RenderSettings& settings, SplatView<S>* s) {
  s->low_pass = settings.mip ? S(0.1) : S(0.3);
  s->filtered_det = s->det + s->low_pass * (s->xx + s->yy + s->low_pass);
  if (settings.mip) s->kept *= std::sqrt(s->det / s->filtered_det);
}

template <class S>
void Colour(const BasicCloud<S>& cloud, size_t i, const PinholeView<S>& view, SplatView<S>* s) {
  const Vec3<S> from_camera = s->placed.mean - view.center_in_world;
  s->distance = from_camera.norm();
  s->direction = s->placed.world_from_face.transpose() * (from_camera / s->distance);
  const int degree = cloud.values.degree, n = BasisSize(degree);
  EvaluateBasis<S>(s->direction, degree, s->basis);
  const S* colour = cloud.values.colour.data() + i * static_cast<size_t>(3 * n);
  for (int c = 0; c < 3; ++c) {
    s->rgb[c] = S(0.5);
    for (int k = 0; k < n; ++k) s->rgb[c] += s->basis[k] * colour[3 * k + c];
  }
}

template <class S>
SplatView<S> SeeSplat(const BasicCloud<S>& cloud, size_t i, const Surface<S>& surface, const PinholeView<S>& view,
                      const RenderSettings& settings) {
  SplatView<S> s;
  s.placed = PlaceSplat(cloud, i, surface);
  s.status = s.placed.status;
  if (s.status != Status::kOk) return s;
  s.mean_in_cam = view.cam_from_world * s.placed.mean + view.world_in_cam;
  if (!(s.mean_in_cam[2] > S(kNearPlane))) {
    s.status = Status::kBehindCamera;
    return s;
  }
  const Eigen::Matrix<S, 4, 1> q = Eigen::Map<const Eigen::Matrix<S, 4, 1>>(cloud.values.rotation.data() + 4 * i);
  s.quaternion_norm = q.norm();
  s.quaternion = q / s.quaternion_norm;
  s.face_from_own = MatrixOf(s.quaternion);
  SmoothScales(cloud, i, &s);
  LinearProjection(view, &s);
  LowPass(settings, &s);
  s.sigmoid = 1 / (1 + std::exp(-cloud.values.opacity[i]));
  Colour(cloud, i, view, &s);
  const S sum = s.xx + s.yy + s.filtered_det + s.kept + s.sigmoid + s.rgb[0] + s.rgb[1] + s.rgb[2];
  if (!std::isfinite(sum)) s.status = Status::kNonFiniteInput;
  return s;
}

}  // namespace mvstudio::splats
