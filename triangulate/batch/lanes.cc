#include "triangulate/batch/lanes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "triangulate/batch/lane_algebra.h"
#include "triangulate/point/robust.h"

namespace mvstudio::triangulate::internal {
namespace {

using geometry::DistortPlane;
using geometry::LensModel;
using geometry::PlaneDistortion;

static_assert(alignof(PlaneDistortion<Lanes<float>::Value>) == 32 && alignof(Symmetric<double>) == 32);

/// One camera's detections of the points in the lanes; weights are 0 where it has none.
template <class S>
struct alignas(32) LaneView {
  Value<S> a, b;                // normalised, distorted
  Value<S> ray_a, ray_b;        // normalised, undistorted
  Value<S> weight_a, weight_b;  // focal length over sigma
  Value<S> variance;            // px^2
  Mask<S> seen;
};

/// What a pass over the views sums up for each lane.
template <class S>
struct LaneSums {
  Symmetric<S> information;
  Vec3<S> gradient;
  Value<S> chi_squared{}, worst_squared{}, squared_px{};
  Value<S> nearest_squared;
  Mask<S> failed{};
};

/// Gauss-Newton terms of all views at x.
template <class S>
MVS_INLINE LaneSums<S> Linearize(const LaneRig<S>& rig, const LaneView<S>* views, const Vec3<S>& x) {
  LaneSums<S> sums;
  const Value<S> far = Broadcast<S>(std::numeric_limits<S>::max()), zero{};
  sums.nearest_squared = far;
  const int count = static_cast<int>(rig.cameras.size());
  for (int c = 0; c < count; ++c) {
    const LaneCamera<S>& camera = rig.cameras[c];
    const LaneView<S>& view = views[c];
    const S *r = camera.rotation, *t = camera.translation;
    const Value<S> in_x = r[0] * x.x + r[1] * x.y + r[2] * x.z + t[0];
    const Value<S> in_y = r[3] * x.x + r[4] * x.y + r[5] * x.z + t[1];
    const Value<S> in_z = r[6] * x.x + r[7] * x.y + r[8] * x.z + t[2];
    const Value<S> inverse = (in_z > zero) ? S(1) / in_z : zero;
    const Value<S> a = in_x * inverse, b = in_y * inverse;
    sums.failed |= view.seen & (~(in_z > zero) | ~(a * a + b * b <= camera.valid_radius_squared));
    const PlaneDistortion<Value<S>> m = DistortPlane(camera.model, camera.distortion, a, b);
    const Value<S> residual_a = view.weight_a * (m.a - view.a), residual_b = view.weight_b * (m.b - view.b);
    const Value<S> scale_a = view.weight_a * inverse, scale_b = view.weight_b * inverse;
    const Value<S> ax = scale_a * m.a_by_a, ay = scale_a * m.a_by_b, az = -(ax * a + ay * b);
    const Value<S> bx = scale_b * m.b_by_a, by = scale_b * m.b_by_b, bz = -(bx * a + by * b);
    const Vec3<S> row_a{ax * r[0] + ay * r[3] + az * r[6], ax * r[1] + ay * r[4] + az * r[7],
                        ax * r[2] + ay * r[5] + az * r[8]};
    const Vec3<S> row_b{bx * r[0] + by * r[3] + bz * r[6], bx * r[1] + by * r[4] + bz * r[7],
                        bx * r[2] + by * r[5] + bz * r[8]};
    const Value<S> one = Broadcast<S>(1);
    sums.information.AddOuter(one, row_a.x, row_a.y, row_a.z);
    sums.information.AddOuter(one, row_b.x, row_b.y, row_b.z);
    sums.gradient.x += row_a.x * residual_a + row_b.x * residual_b;
    sums.gradient.y += row_a.y * residual_a + row_b.y * residual_b;
    sums.gradient.z += row_a.z * residual_a + row_b.z * residual_b;
    const Value<S> squared = residual_a * residual_a + residual_b * residual_b;
    sums.chi_squared += squared;
    sums.worst_squared = squared > sums.worst_squared ? squared : sums.worst_squared;
    sums.squared_px += squared * view.variance;
    const Value<S> distance = in_x * in_x + in_y * in_y + in_z * in_z;
    sums.nearest_squared = (view.seen & (distance < sums.nearest_squared)) ? distance : sums.nearest_squared;
  }
  return sums;
}

/// Reads one camera's detections; lanes with detections that cannot be used (infinite, no sigma) are set in `failed`.
template <class S>
MVS_INLINE void LoadView(const LaneCamera<S>& camera, const PointBatch& batch, int64_t at, int count, LaneView<S>* view,
                         Value<S>* num_seen, Mask<S>* failed) {
  const Value<S> u = Load<S>(&batch.x_px[at], count, camera.principal[0], camera.focal[0]);
  const Value<S> v = Load<S>(&batch.y_px[at], count, camera.principal[1], camera.focal[1]);
  const Value<S> sigma = Load<S>(&batch.sigma_px[at], count), zero{}, one = Broadcast<S>(1);
  const Mask<S> offered = (u == u) & (v == v);
  view->seen = (u - u == zero) & (v - v == zero) & (sigma > zero) & (sigma - sigma == zero);
  *failed |= offered & ~view->seen;
  const Value<S> inverse_sigma = view->seen ? one / sigma : zero;
  view->a = view->seen ? u : zero;
  view->b = view->seen ? v : zero;
  view->weight_a = static_cast<S>(camera.focal[0]) * inverse_sigma;
  view->weight_b = static_cast<S>(camera.focal[1]) * inverse_sigma;
  view->variance = view->seen ? sigma * sigma : zero;
  *num_seen += view->seen ? one : zero;
}

/// Undistorts by Newton's method; lanes without an inverse inside the valid radius are set in `failed`.
template <class S>
MVS_INLINE void Undistort(const LaneCamera<S>& camera, LaneView<S>* lane_view, Mask<S>* failed) {
  LaneView<S>& view = *lane_view;
  Value<S>*a = &view.ray_a, *b = &view.ray_b;
  constexpr int kMaxSteps = 8;
  const S limit = Lanes<S>::kUnprojectPx / camera.mean_focal;
  const Value<S> zero{};
  *a = view.a, *b = view.b;
  if (camera.model == LensModel::kPinhole) return;
  Mask<S> open{};
  for (int step = 0; step < kMaxSteps; ++step) {
    const PlaneDistortion<Value<S>> m = DistortPlane(camera.model, camera.distortion, *a, *b);
    const Value<S> rest_a = view.a - m.a, rest_b = view.b - m.b;
    const Value<S> determinant = m.a_by_a * m.b_by_b - m.a_by_b * m.b_by_a;
    open = ~((rest_a * rest_a + rest_b * rest_b <= limit * limit) & (determinant > zero));
    const Value<S> scale = S(1) / determinant;
    // A lane that has arrived stays, so that its neighbours' steps do not matter to it.
    *a += open ? scale * (m.b_by_b * rest_a - m.a_by_b * rest_b) : zero;
    *b += open ? scale * (m.a_by_a * rest_b - m.b_by_a * rest_a) : zero;
    int any = 0;
    for (int l = 0; l < Lanes<S>::kWidth; ++l) any |= open[l] != 0;
    if (!any) break;
  }
  *failed |= view.seen & (open | ~(*a * *a + *b * *b <= camera.valid_radius_squared));
}

/// Adds a view's ray to the normal equations of the point nearest to all rays.
template <class S>
MVS_INLINE void AddRay(const LaneCamera<S>& camera, const LaneView<S>& view, const Value<S>& weight, Symmetric<S>* sum,
                       Vec3<S>* right) {
  const S *r = camera.rotation, *c = camera.center;
  const Value<S>&a = view.ray_a, &b = view.ray_b;
  const Vec3<S> ray{r[0] * a + r[3] * b + r[6], r[1] * a + r[4] * b + r[7], r[2] * a + r[5] * b + r[8]};
  const Value<S> per_square = weight / (a * a + b * b + S(1));
  sum->AddOuter(-per_square, ray.x, ray.y, ray.z);
  sum->xx += weight, sum->yy += weight, sum->zz += weight;
  const Value<S> along = per_square * (ray.x * c[0] + ray.y * c[1] + ray.z * c[2]);
  right->x += weight * c[0] - along * ray.x;
  right->y += weight * c[1] - along * ray.y;
  right->z += weight * c[2] - along * ray.z;
}

template <class S>
struct LaneFit {
  Vec3<S> x;
  LaneSums<S> sums;
  Symmetric<S> covariance;
  Mask<S> good;
  Mask<S> broken;  ///< with detections that cannot be used or have no ray
};

/// Midpoint of the rays, weighted by their angular noise unless that is what is asked for; with `near`, by the inverse squared
/// distance from it too.
template <class S>
MVS_INLINE Vec3<S> SolveRays(const LaneRig<S>& rig, const LaneView<S>* views, bool weighted, const Vec3<S>* near,
                             Mask<S>* failed) {
  Symmetric<S> sum;
  Vec3<S> right;
  const Value<S> one = Broadcast<S>(1), zero{};
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const LaneCamera<S>& camera = rig.cameras[c];
    Value<S> weight = weighted ? views[c].weight_a * views[c].weight_b : views[c].seen ? one : zero;
    if (near) {
      const Vec3<S> apart{near->x - camera.center[0], near->y - camera.center[1], near->z - camera.center[2]};
      weight = views[c].seen ? weight / Dot(apart, apart) : zero;
    }
    AddRay(camera, views[c], weight, &sum, &right);
  }
  const Inverse<S> inverse = Invert(sum);
  const Value<S> size = sum.Trace() / S(3);
  *failed |= ~(inverse.determinant > S(Lanes<S>::kMinDeterminant) * size * size * size);
  return Apply(inverse.matrix, right);
}

/// Every check of TriangulatePoint, on the safe side.
template <class S>
MVS_INLINE Mask<S> PassesChecks(const LaneSums<S>& sums, const Symmetric<S>& covariance, const Value<S>& next_step,
                                const Value<S>& num_seen, double extent, const BatchOptions& options) {
  const PointOptions& point = options.point;
  const S tiny = options.gauss_newton_steps > 0 ? S(0.01) : S(Lanes<S>::kTinyStep);
  const S parallax = static_cast<S>(point.min_parallax_sigmas * point.min_parallax_sigmas);
  const S min_distance = static_cast<S>(1e-12 * extent * extent);
  const Value<S> trace = covariance.Trace(), zero{};
  Mask<S> good = ~sums.failed & (next_step < tiny) & (next_step >= zero) & (trace > zero);
  good &= (trace * parallax <= sums.nearest_squared) & (trace * sums.information.Trace() < S(Lanes<S>::kMaxCondition));
  good &= (sums.nearest_squared > min_distance) & (num_seen >= static_cast<S>(std::max(point.min_views, 2)));
  if (point.max_distance_m > 0) good &= sums.nearest_squared <= static_cast<S>(point.max_distance_m * point.max_distance_m);
  if (point.method == PointMethod::kRobust || point.select_views) {
    good &= sums.worst_squared <= static_cast<S>(point.max_residual_sigmas * point.max_residual_sigmas);
  }
  return good;
}

template <class S>
MVS_INLINE LaneFit<S> Fit(const LaneRig<S>& rig, const PointBatch& batch, const BatchOptions& options, int64_t first, int count,
                          LaneView<S>* views) {
  const PointMethod method = options.point.method;
  const bool closed = method == PointMethod::kLinear || method == PointMethod::kMidpoint;
  Value<S> num_seen{};
  Mask<S> failed{};
  for (int c = 0; c < batch.num_cameras; ++c) {
    LoadView(rig.cameras[c], batch, c * batch.num_points + first, count, &views[c], &num_seen, &failed);
    Undistort(rig.cameras[c], &views[c], &failed);
  }
  LaneFit<S> fit;
  fit.broken = failed;
  fit.x = SolveRays<S>(rig, views, method != PointMethod::kMidpoint, nullptr, &failed);
  if (method == PointMethod::kLinear) {
    const Vec3<S> near = fit.x;
    fit.x = SolveRays<S>(rig, views, true, &near, &failed);
  }
  const int steps = closed ? 0 : options.gauss_newton_steps > 0 ? options.gauss_newton_steps : Lanes<S>::kSteps;
  for (int step = 0;; ++step) {
    fit.sums = Linearize(rig, views, fit.x);
    fit.covariance = Invert(fit.sums.information).matrix;
    const Vec3<S> move = Apply(fit.covariance, fit.sums.gradient);
    failed |= fit.sums.failed;
    if (step == steps) {
      fit.sums.failed |= failed;
      const Value<S> next_step = closed ? Value<S>{} : Dot(move, fit.sums.gradient);
      fit.good = PassesChecks(fit.sums, fit.covariance, next_step, num_seen, rig.extent, options);
      return fit;
    }
    fit.x.x -= move.x, fit.x.y -= move.y, fit.x.z -= move.z;
  }
}

template <class S>
void Write(const LaneFit<S>& fit, const LaneView<S>* views, const PreparedRig& prepared, int64_t i, int lane, BatchResult* r) {
  const int64_t n = r->num_points;
  const Symmetric<S>& m = fit.covariance;
  r->status[i] = static_cast<uint8_t>(Status::kOk);
  r->x[i] = prepared.origin_in_world.x() + static_cast<double>(fit.x.x[lane]);
  r->y[i] = prepared.origin_in_world.y() + static_cast<double>(fit.x.y[lane]);
  r->z[i] = prepared.origin_in_world.z() + static_cast<double>(fit.x.z[lane]);
  const S covariance[6] = {m.xx[lane], m.xy[lane], m.xz[lane], m.yy[lane], m.yz[lane], m.zz[lane]};
  for (int k = 0; k < 6; ++k) r->covariance[k * n + i] = covariance[k];
  r->chi_squared[i] = fit.sums.chi_squared[lane];
  int count = 0;
  for (int c = 0; c < r->num_cameras; ++c) {
    if (!views[c].seen[lane]) continue;
    ++count;
    r->used[c / 64 * n + i] |= uint64_t{1} << (c % 64);
  }
  r->num_views[i] = count;
  r->rms_px[i] = std::sqrt(static_cast<double>(fit.sums.squared_px[lane]) / count);
}

/// The rest of TriangulatePoint for a lane, whose rays need not be found again.
template <class S>
[[gnu::noinline]] void SolveFromRays(const PreparedRig& prepared, const PointBatch& batch, const BatchOptions& options,
                                     const LaneView<S>* lanes, int64_t i, int lane, BatchResult* result) {
  std::vector<View> views;
  views.reserve(static_cast<size_t>(batch.num_cameras));
  for (int c = 0; c < batch.num_cameras; ++c) {
    if (!lanes[c].seen[lane]) continue;
    const PreparedCamera& camera = prepared.cameras[c];
    const int64_t at = c * batch.num_points + i;
    const Eigen::Vector3d ray(lanes[c].ray_a[lane], lanes[c].ray_b[lane], 1);
    views.push_back({&camera,
                     {batch.x_px[at], batch.y_px[at]},
                     batch.sigma_px[at],
                     batch.sigma_px[at] / camera.focal_px,
                     camera.cam_from_local_rotation.transpose() * ray.normalized(),
                     c});
  }
  PointOptions own = options.point;
  own.seed += static_cast<uint64_t>(options.first_point + i);
  StorePoint(TriangulateViews(prepared, views, views.size(), Status::kOk, own), i, result);
}

template <class S>
MVS_INLINE void SolveRange(const LaneRig<S>& rig, const PreparedRig& prepared, const PointBatch& batch,
                           const BatchOptions& options, int64_t first, int64_t count, LaneView<S>* views, BatchResult* result,
                           uint8_t* done) {
  constexpr int64_t kWidth = Lanes<S>::kWidth;
  for (int64_t k = 0; k < count; k += kWidth) {
    const int lanes = static_cast<int>(std::min(kWidth, count - k));
    const LaneFit<S> fit = Fit(rig, batch, options, first + k, lanes, views);
    for (int l = 0; l < lanes; ++l) {
      if (fit.good[l]) {
        Write(fit, views, prepared, first + k + l, l, result);
        done[k + l] = 1;
      } else if (std::is_same_v<S, double> && !fit.broken[l]) {
        SolveFromRays(prepared, batch, options, views, first + k + l, l, result);
        done[k + l] = 1;
      }
    }
  }
}

template <class S>
void SolvePlain(const LaneRig<S>& rig, const PreparedRig& prepared, const PointBatch& batch, const BatchOptions& options,
                int64_t first, int64_t count, LaneView<S>* views, BatchResult* result, uint8_t* done) {
  SolveRange(rig, prepared, batch, options, first, count, views, result, done);
}

#if defined(__x86_64__)
bool HasWideRegisters() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
template <class S>
[[gnu::target("avx2,fma")]] void SolveWide(const LaneRig<S>& rig, const PreparedRig& prepared, const PointBatch& batch,
                                           const BatchOptions& options, int64_t first, int64_t count, LaneView<S>* views,
                                           BatchResult* result, uint8_t* done) {
  SolveRange(rig, prepared, batch, options, first, count, views, result, done);
}
#else
bool HasWideRegisters() { return false; }
template <class S>
void SolveWide(const LaneRig<S>& rig, const PreparedRig& prepared, const PointBatch& batch, const BatchOptions& options,
               int64_t first, int64_t count, LaneView<S>* views, BatchResult* result, uint8_t* done) {
  SolvePlain(rig, prepared, batch, options, first, count, views, result, done);
}
#endif

template <class S>
LaneCamera<S> MakeLaneCamera(const PreparedCamera& prepared) {
  const geometry::Camera& lens = prepared.projector.camera();
  LaneCamera<S> camera;
  camera.model = lens.model;
  for (Eigen::Index i = 4; i < lens.params.size(); ++i) camera.distortion[i - 4] = static_cast<S>(lens.params[i]);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) camera.rotation[3 * i + j] = static_cast<S>(prepared.cam_from_local_rotation(i, j));
    camera.translation[i] = static_cast<S>(prepared.cam_from_local_translation[i]);
    camera.center[i] = static_cast<S>(prepared.center_in_local[i]);
  }
  for (int i = 0; i < 2; ++i) {
    camera.focal[i] = lens.params[i];
    camera.principal[i] = lens.params[2 + i];
  }
  const double limit = std::min(prepared.projector.valid_radius(), 1e15);
  camera.valid_radius_squared = static_cast<S>(limit * limit);
  camera.mean_focal = static_cast<S>(prepared.focal_px);
  return camera;
}

}  // namespace

bool FitsLanes(const PreparedRig& rig) {
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    if (!geometry::TraitsOf(rig.cameras[c].projector.camera().model).arithmetic || rig.duplicate_of[c] >= 0) return false;
  }
  return true;
}

template <class S>
LaneRig<S> MakeLaneRig(const PreparedRig& rig) {
  LaneRig<S> lanes;
  for (const PreparedCamera& camera : rig.cameras) {
    lanes.cameras.push_back(MakeLaneCamera<S>(camera));
    lanes.extent = std::max(lanes.extent, 2 * camera.center_in_local.norm());
  }
  return lanes;
}

template <class S>
void SolveInLanes(const LaneRig<S>& rig, const PreparedRig& prepared, const PointBatch& batch, const BatchOptions& options,
                  int64_t first, int64_t count, BatchResult* result, uint8_t* done) {
  static const bool wide = HasWideRegisters();
  std::vector<LaneView<S>> views(rig.cameras.size());
  const auto solve = wide ? SolveWide<S> : SolvePlain<S>;
  solve(rig, prepared, batch, options, first, count, views.data(), result, done);
}

template LaneRig<double> MakeLaneRig(const PreparedRig&);
template LaneRig<float> MakeLaneRig(const PreparedRig&);
template void SolveInLanes(const LaneRig<double>&, const PreparedRig&, const PointBatch&, const BatchOptions&, int64_t, int64_t,
                           BatchResult*, uint8_t*);
template void SolveInLanes(const LaneRig<float>&, const PreparedRig&, const PointBatch&, const BatchOptions&, int64_t, int64_t,
                           BatchResult*, uint8_t*);

}  // namespace mvstudio::triangulate::internal
