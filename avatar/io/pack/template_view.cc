#include "avatar/io/pack/template_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "avatar/maps/spread_labels.h"
#include "body/mesh_raster.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

constexpr int kFiner = 4;

/// Samples of one pixel by part.
struct Samples {
  std::array<int, 25> count{};
  std::array<float, 25> u{}, v{};
};

Samples SamplesOf(const body::PartUvMap& fine, int x, int y) {
  Samples s;
  for (int dy = 0; dy < kFiner; ++dy) {
    for (int dx = 0; dx < kFiner; ++dx) {
      const size_t at = static_cast<size_t>(y * kFiner + dy) * fine.width + x * kFiner + dx;
      const uint8_t part = fine.part[at];
      ++s.count[part], s.u[part] += fine.u[at], s.v[part] += fine.v[at];
    }
  }
  return s;
}

}  // namespace

std::optional<Eigen::Matrix3Xf> PosedVertices(const body::BodyTemplate& body, const dataset::Coco19Pose& pose) {
  body::BodyPose posed;
  if (!body::PoseFromJoints(body, pose.x_in_world, dataset::PlausibleJoints(pose), &posed)) return std::nullopt;
  return body::SkinVertices(body, posed);
}

std::optional<Eigen::Matrix3Xf> PosedVertices(const body::PersonBody& person, const dataset::Coco19Pose& pose) {
  const auto posed = body::PoseByJoints(person, pose.x_in_world, dataset::PlausibleJoints(pose));
  if (!posed) return std::nullopt;
  return SkinVertices(person.body, ToBodyPose(person.body, *posed));
}

void FillTemplateMaps(const body::BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world,
                      const geometry::RigCamera& crop, int size_px, float* maps) {
  const body::PartUvMap fine = body::RasterizeBody(body, vertices_in_world, dataset::ResizedCrop(crop, kFiner * size_px));
  const int64_t area = int64_t{size_px} * size_px;
  std::vector<uint8_t> parts(area);
  float *cover = maps, *uv = maps + 2 * area;
  for (int64_t p = 0; p < area; ++p) {
    const Samples s = SamplesOf(fine, static_cast<int>(p % size_px), static_cast<int>(p / size_px));
    const auto part = std::max_element(s.count.begin() + 1, s.count.end()) - s.count.begin();
    const auto count = static_cast<float>(s.count[part]);
    cover[p] = 1 - static_cast<float>(s.count[0]) / (kFiner * kFiner);
    parts[p] = count > 0 ? static_cast<uint8_t>(part) : 0;
    uv[p] = count > 0 ? s.u[part] / count : 0, uv[area + p] = count > 0 ? s.v[part] / count : 0;
  }
  SpreadLabels(size_px, nullptr, parts.data(), uv);
  std::copy(parts.begin(), parts.end(), maps + area);
}

void FillTemplateColours(const body::BodyTemplate& body, const body::Textures& textures,
                         const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& crop, int size_px,
                         uint8_t* colours) {
  const body::RenderedBody seen = RenderBody(body, textures, vertices_in_world, dataset::ResizedCrop(crop, size_px));
  const std::vector<int64_t> nearest = NearestPixels(size_px, nullptr, seen.cover.pixels.data());
  const int64_t area = int64_t{size_px} * size_px;
  for (int64_t p = 0; p < area; ++p) {
    const int64_t from = nearest[p];
    for (int k = 0; k < 3; ++k) {
      const int cover = from < 0 ? 0 : seen.cover.pixels[from];
      const double colour = cover > 0 ? 255.0 * seen.image.pixels[3 * from + k] / cover : 0;
      colours[k * area + p] = static_cast<uint8_t>(std::lround(std::min(colour, 255.0)));
    }
  }
}

}  // namespace mvstudio::avatar
