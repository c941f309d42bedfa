#include "avatar/splats/train/density.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "avatar/splats/splat_view.h"
#include "core/check.h"
#include "core/parallel.h"

namespace mvstudio::splats {
namespace {

float Sigmoid(float logit) { return 1 / (1 + std::exp(-logit)); }
float Logit(float p) { return std::log(p / (1 - p)); }

/// The Gaussians to be divided: the largest mean gradients, at most `count` of those that were seen.
std::vector<size_t> MostMoved(const ViewSpaceGradients& gradients, size_t count) {
  std::vector<std::pair<float, size_t>> order;
  for (size_t i = 0; i < gradients.sum.size(); ++i) {
    const float mean = gradients.seen[i] > 0 ? gradients.sum[i] / static_cast<float>(gradients.seen[i]) : 0;
    if (mean > 0) order.emplace_back(-mean, i);
  }
  std::sort(order.begin(), order.end());
  std::vector<size_t> out;
  for (size_t k = 0; k < std::min(count, order.size()); ++k) out.push_back(order[k].second);
  std::sort(out.begin(), out.end());
  return out;
}

int WidestAxis(const Cloud& cloud, size_t i) {
  const float* scale = cloud.values.log_scale.data() + 3 * i;
  return static_cast<int>(std::max_element(scale, scale + 3) - scale);
}

/// Moves a Gaussian by `by_in_face`, metres in its triangle's frame at rest.
void Shift(const Surface<float>& rest, const Eigen::Vector3f& by_in_face, size_t i, Cloud* cloud) {
  const Placed<float> placed = PlaceSplat(*cloud, i, rest);
  if (placed.status != Status::kOk) return;
  const Eigen::Matrix3f face_from_world = placed.world_from_face.transpose();
  Eigen::Matrix2f edges;
  edges.col(0) = (face_from_world * placed.edge1).head<2>(), edges.col(1) = (face_from_world * placed.edge2).head<2>();
  const float determinant = edges(0, 0) * edges(1, 1);  // edge1 lies along the first axis
  const float second = by_in_face[1] / edges(1, 1);
  const float first = (by_in_face[0] * edges(1, 1) - edges(0, 1) * by_in_face[1]) / determinant;
  cloud->values.place[2 * i] += first, cloud->values.place[2 * i + 1] += second;
  cloud->values.offset[i] += by_in_face[2];
}

/// Two halves along the widest axis, `twin` being a copy of `i`.
void Split(const Surface<float>& rest, size_t i, size_t twin, Cloud* cloud) {
  constexpr float kApart = 0.7f;     // standard deviations of each half from the middle
  constexpr float kSmaller = 0.47f;  // log(1.6), as in Kerbl et al.
  const int axis = WidestAxis(*cloud, i);
  const Eigen::Vector4f q = Eigen::Map<const Eigen::Vector4f>(cloud->values.rotation.data() + 4 * i).normalized();
  const Eigen::Vector3f along =
      MatrixOf<float>(q).col(axis) * Scale(cloud->values.log_scale[3 * i + static_cast<size_t>(axis)]) * kApart;
  Shift(rest, along, i, cloud);
  Shift(rest, -along, twin, cloud);
  for (const size_t half : {i, twin}) cloud->values.log_scale[3 * half + static_cast<size_t>(axis)] -= kSmaller;
}

/// The twin a little beside, both with half of the optical depth.
void Clone(const Surface<float>& rest, size_t i, size_t twin, Rng* rng, Cloud* cloud) {
  constexpr float kBeside = 0.25f;  // standard deviations
  const float width = Scale(cloud->values.log_scale[3 * i + static_cast<size_t>(WidestAxis(*cloud, i))]) * kBeside;
  const auto x = static_cast<float>(rng->Normal()), y = static_cast<float>(rng->Normal());
  Shift(rest, Eigen::Vector3f(x * width, y * width, 0), twin, cloud);
  const float opacity = Sigmoid(cloud->values.opacity[i]);
  const float half = Logit(std::clamp(1 - std::sqrt(1 - opacity), 1e-4f, 0.9999f));
  cloud->values.opacity[i] = cloud->values.opacity[twin] = half;
}

/// The same with the moments of the first ones; those of the others are 0.
void SelectMoments(const std::vector<size_t>& indices, size_t num_kept, Parameters<float>* moments) {
  *moments = Select(*moments, indices);
  ForEachGroup(*moments, [&](Group, int width, std::vector<float>& array) {
    std::fill(array.begin() + static_cast<std::ptrdiff_t>(num_kept) * width, array.end(), 0.f);
  });
}

}  // namespace

std::vector<float> PixelSizes(const Cloud& cloud, const Eigen::Matrix3Xi& faces, const std::vector<PinholeView<float>>& views,
                              const std::vector<const Eigen::Matrix3Xf*>& vertices, int num_threads) {
  MVS_CHECK(views.size() == vertices.size(), views.size() << " cameras of " << vertices.size() << " posed bodies");
  constexpr int64_t kChunk = 1024;
  constexpr float kNone = std::numeric_limits<float>::infinity();
  const auto n = static_cast<int64_t>(cloud.size());
  std::vector<float> out(cloud.size(), kNone);
  ParallelFor((n + kChunk - 1) / kChunk, num_threads, [&](int64_t chunk) {
    for (int64_t i = chunk * kChunk; i < std::min(n, (chunk + 1) * kChunk); ++i) {
      for (size_t v = 0; v < views.size(); ++v) {
        const Placed<float> placed = PlaceSplat(cloud, static_cast<size_t>(i), {faces, *vertices[v]});
        if (placed.status != Status::kOk) continue;
        const Eigen::Vector3f x = views[v].cam_from_world * placed.mean + views[v].world_in_cam;
        if (!(x[2] > static_cast<float>(kNearPlane))) continue;
        const float u = x[0] / x[2], w = x[1] / x[2];
        if (u < views[v].low_x || u > views[v].high_x || w < views[v].low_y || w > views[v].high_y) continue;
        out[static_cast<size_t>(i)] = std::min(out[static_cast<size_t>(i)], x[2] / std::max(views[v].fx, views[v].fy));
      }
    }
  });
  float coarsest = 0;
  for (const float size : out) coarsest = std::isfinite(size) ? std::max(coarsest, size) : coarsest;
  for (float& size : out) size = std::isfinite(size) ? size : coarsest;
  return out;
}

void SetFilters(const std::vector<float>& pixel_m, Cloud* cloud) {
  MVS_CHECK(pixel_m.size() == cloud->size(), pixel_m.size() << " sizes of " << cloud->size() << " Gaussians");
  for (size_t i = 0; i < pixel_m.size(); ++i) cloud->filter_variance[i] = 0.2f * pixel_m[i] * pixel_m[i];
}

DensityReport Densify(const DensityOptions& options, const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& rest,
                      const ViewSpaceGradients& gradients, Rng* rng, Cloud* cloud, AdamState* state,
                      std::vector<float>* pixel_m) {
  MVS_CHECK(gradients.sum.size() == cloud->size() && pixel_m->size() == cloud->size(), "gradients of another cloud");
  DensityReport report;
  const auto n = static_cast<int64_t>(cloud->size());
  const int64_t room = std::max<int64_t>(0, options.most - n);
  const auto wanted = static_cast<int64_t>(options.growth * static_cast<double>(n));
  std::vector<size_t> kept, divided;
  for (const size_t i : MostMoved(gradients, static_cast<size_t>(std::min(room, wanted)))) divided.push_back(i);
  const auto useful = [&](size_t i) { return Sigmoid(cloud->values.opacity[i]) >= static_cast<float>(options.least_opacity); };
  std::vector<size_t> place(cloud->size());
  for (size_t i = 0; i < cloud->size(); ++i) {
    place[i] = kept.size();
    if (useful(i)) kept.push_back(i);
  }
  report.pruned = n - static_cast<int64_t>(kept.size());
  divided.erase(std::remove_if(divided.begin(), divided.end(), [&](size_t i) { return !useful(i); }), divided.end());
  std::vector<size_t> indices = kept;
  indices.insert(indices.end(), divided.begin(), divided.end());
  *cloud = Select(*cloud, indices);
  SelectMoments(indices, kept.size(), &state->first);
  SelectMoments(indices, kept.size(), &state->second);
  std::vector<float> sizes;
  for (const size_t i : indices) sizes.push_back((*pixel_m)[i]);
  *pixel_m = sizes;
  const Surface<float> surface{faces, rest};
  for (size_t k = 0; k < divided.size(); ++k) {
    const size_t i = place[divided[k]], twin = kept.size() + k;
    const float widest = Scale(cloud->values.log_scale[3 * i + static_cast<size_t>(WidestAxis(*cloud, i))]);
    const bool wide = widest > static_cast<float>(options.split_px) * sizes[i];
    wide ? Split(surface, i, twin, cloud) : Clone(surface, i, twin, rng, cloud);
    ++(wide ? report.split : report.cloned);
  }
  return report;
}

void Confine(Cloud* cloud) {
  constexpr float kOutside = 0.5f, kFarthest = 0.1f, kLeast = -9.21f, kMost = -1.609f, kMostLogit = 6, kMostBend = 5;
  const auto into = [](float low, float high, float* value) { *value = std::min(std::max(*value, low), high); };
  for (size_t i = 0; i < cloud->size(); ++i) {
    Parameters<float>& v = cloud->values;
    for (size_t k = 0; k < 2; ++k) into(-kOutside, 1 + kOutside, &v.place[2 * i + k]);
    into(-kFarthest, kFarthest, &v.offset[i]);
    for (size_t k = 0; k < 3; ++k) into(kLeast, kMost, &v.log_scale[3 * i + k]);
    into(-kMostLogit, kMostLogit, &v.opacity[i]);
    Eigen::Map<Eigen::Vector4f> q(v.rotation.data() + 4 * i);
    const float norm = q.norm();
    if (norm > 1e-6f)
      q /= norm;
    else
      q << 0, 0, 0, 1;
  }
  for (float& value : cloud->values.bend) into(-kMostBend, kMostBend, &value);
}

}  // namespace mvstudio::splats
