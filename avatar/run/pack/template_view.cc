#include "avatar/run/pack/template_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "avatar/body/mesh_raster.h"
#include "avatar/maps/spread_labels.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

constexpr int kFiner = 4;

/// Finer pixels of one pixel, row by row.
struct Samples {
  std::array<uint8_t, kFiner * kFiner> part{};
  std::array<float, kFiner * kFiner> u{}, v{};
};

Samples SamplesOf(const body::PartUvMap& fine, int x, int y) {
  Samples s;
  for (int i = 0; i < kFiner * kFiner; ++i) {
    const size_t at = static_cast<size_t>(y * kFiner + i / kFiner) * fine.width + x * kFiner + i % kFiner;
    s.part[i] = fine.part[at], s.u[i] = fine.u[at], s.v[i] = fine.v[at];
  }
  return s;
}

struct Label {
  uint8_t part = 0;
  float u = 0, v = 0, cover = 0;
};

/// Mean coordinates of a part's samples. Where a chart's ends meet they jump: only those on the side of the sample nearest to
/// the middle count.
void AverageCoordinates(const Samples& s, Label* label) {
  constexpr std::array<int, kFiner* kFiner> kFromMiddle = {5, 6, 9, 10, 1, 2, 4, 7, 8, 11, 13, 14, 0, 3, 12, 15};
  const int* middle = std::find_if(kFromMiddle.begin(), kFromMiddle.end(), [&](int i) { return s.part[i] == label->part; });
  double u = 0, v = 0, count = 0;
  for (int i = 0; i < kFiner * kFiner; ++i) {
    if (s.part[i] != label->part) continue;
    if (std::abs(s.u[i] - s.u[*middle]) > 0.5f || std::abs(s.v[i] - s.v[*middle]) > 0.5f) continue;
    u += s.u[i], v += s.v[i], ++count;
  }
  label->u = static_cast<float>(u / count), label->v = static_cast<float>(v / count);
}

Label LabelOf(const Samples& s) {
  std::array<int, body::kNumParts + 1> count{};
  for (const uint8_t part : s.part) ++count[part];
  Label label;
  label.cover = 1 - static_cast<float>(count[0]) / (kFiner * kFiner);
  if (label.cover == 0) return label;
  label.part = static_cast<uint8_t>(std::max_element(count.begin() + 1, count.end()) - count.begin());
  AverageCoordinates(s, &label);
  return label;
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
    const Label label = LabelOf(SamplesOf(fine, static_cast<int>(p % size_px), static_cast<int>(p / size_px)));
    parts[p] = label.part, cover[p] = label.cover, uv[p] = label.u, uv[area + p] = label.v;
  }
  SpreadLabels(size_px, nullptr, parts.data(), uv);
  std::copy(parts.begin(), parts.end(), maps + area);
}

void FillTemplateColours(const body::BodyTemplate& body, const body::Textures& textures,
                         const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& crop, int size_px,
                         uint8_t* colours) {
  const body::RenderedBody seen = RenderBody(body, textures, vertices_in_world, dataset::ResizedCrop(crop, size_px));
  const std::vector<int64_t> nearest = NearestPixels(size_px, size_px, nullptr, seen.cover.pixels.data());
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
