#include "avatar/splats/project.h"

#include "avatar/splats/splat_view.h"
#include "core/check.h"
#include "core/parallel.h"

namespace mvstudio::splats {
namespace {

constexpr int64_t kChunk = 1024;  // Gaussians that one call of a thread projects

/// The splat, where it covers something of the image: false where it does not.
template <class S>
bool ToSplat(const SplatView<S>& s, const PinholeView<S>& view, int index, Splat<S>* out) {
  out->opacity = s.sigmoid * s.kept;
  if (!(out->opacity > S(kLeastAlpha))) return false;
  const S z = s.mean_in_cam[2];
  out->x = view.fx * s.mean_in_cam[0] / z + view.cx, out->y = view.fy * s.mean_in_cam[1] / z + view.cy;
  const S xx = s.xx + s.low_pass, yy = s.yy + s.low_pass;
  const S square = 2 * std::log(out->opacity / S(kLeastAlpha));  // of the distance in standard deviations
  out->reach_x = std::sqrt(square * xx), out->reach_y = std::sqrt(square * yy);
  if (!(out->x + out->reach_x >= 0 && out->x - out->reach_x <= S(view.width - 1))) return false;
  if (!(out->y + out->reach_y >= 0 && out->y - out->reach_y <= S(view.height - 1))) return false;
  out->a = yy / s.filtered_det, out->b = -s.xy / s.filtered_det, out->c = xx / s.filtered_det;
  for (int k = 0; k < 3; ++k) out->rgb[k] = std::max(s.rgb[k], S(0));
  out->depth = z;
  out->index = index;
  return true;
}

template <class S>
void CountSkipped(Status status, SkippedSplats* skipped) {
  skipped->degenerate += status == Status::kDegenerate;
  skipped->behind_camera += status == Status::kBehindCamera;
  skipped->not_finite += status == Status::kNonFiniteInput;
}

}  // namespace

template <class S>
PinholeView<S> ViewOf(const geometry::RigCamera& camera) {
  const geometry::Camera& c = camera.camera;
  MVS_CHECK(c.model == geometry::LensModel::kPinhole, "camera " << c.name << " is no pinhole: Gaussians need its crop");
  MVS_CHECK(c.width_px > 0 && c.height_px > 0, "camera " << c.name << " has no pixels");
  PinholeView<S> view;
  view.width = c.width_px, view.height = c.height_px;
  view.fx = S(c.fx()), view.fy = S(c.fy()), view.cx = S(c.cx()), view.cy = S(c.cy());
  view.cam_from_world = camera.cam_from_world.rotation.toRotationMatrix().cast<S>();
  view.world_in_cam = camera.cam_from_world.translation.cast<S>();
  view.center_in_world = camera.CenterInWorld().cast<S>();
  // As in the reference program of Kerbl et al.: the field of view and 15 % of it on each side.
  const double x_margin = 0.15 * c.width_px / c.fx(), y_margin = 0.15 * c.height_px / c.fy();
  view.low_x = S((-0.5 - c.cx()) / c.fx() - x_margin), view.high_x = S((c.width_px - 0.5 - c.cx()) / c.fx() + x_margin);
  view.low_y = S((-0.5 - c.cy()) / c.fy() - y_margin), view.high_y = S((c.height_px - 0.5 - c.cy()) / c.fy() + y_margin);
  return view;
}

template <class S>
Projected<S> ProjectSplats(const BasicCloud<S>& cloud, const Surface<S>& surface, const PinholeView<S>& view,
                           const RenderSettings& settings) {
  const auto n = static_cast<int64_t>(cloud.size());
  const int64_t chunks = (n + kChunk - 1) / kChunk;
  std::vector<Projected<S>> parts(static_cast<size_t>(chunks));
  ParallelFor(chunks, settings.num_threads, [&](int64_t chunk) {
    Projected<S>& part = parts[static_cast<size_t>(chunk)];
    const int64_t end = std::min(n, (chunk + 1) * kChunk);
    part.splats.reserve(static_cast<size_t>(end - chunk * kChunk));
    for (int64_t i = chunk * kChunk; i < end; ++i) {
      const SplatView<S> seen = SeeSplat(cloud, static_cast<size_t>(i), surface, view, settings);
      Splat<S> splat;
      if (seen.status != Status::kOk)
        CountSkipped<S>(seen.status, &part.skipped);
      else if (ToSplat(seen, view, static_cast<int>(i), &splat))
        part.splats.push_back(splat);
    }
  });
  Projected<S> out;
  out.splats.reserve(cloud.size());
  for (const Projected<S>& part : parts) {
    out.splats.insert(out.splats.end(), part.splats.begin(), part.splats.end());
    out.skipped.degenerate += part.skipped.degenerate;
    out.skipped.behind_camera += part.skipped.behind_camera;
    out.skipped.not_finite += part.skipped.not_finite;
  }
  return out;
}

template PinholeView<float> ViewOf(const geometry::RigCamera&);
template PinholeView<double> ViewOf(const geometry::RigCamera&);
template Projected<float> ProjectSplats(const BasicCloud<float>&, const Surface<float>&, const PinholeView<float>&,
                                        const RenderSettings&);
template Projected<double> ProjectSplats(const BasicCloud<double>&, const Surface<double>&, const PinholeView<double>&,
                                         const RenderSettings&);

}  // namespace mvstudio::splats
