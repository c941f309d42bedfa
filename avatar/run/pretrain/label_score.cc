#include "avatar/run/pretrain/label_score.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>

#include "avatar/body/texture/texel_map.h"
#include "avatar/maps/spread_labels.h"
#include "core/check.h"
#include "core/statistics.h"

namespace mvstudio::avatar {
namespace {

constexpr int kTexels = 64;
constexpr int64_t kBatch = 16;

/// The surface points that the texels of a chart show; `known` says which do.
void FillChart(const body::BodyTemplate& body, const body::TexelMap& map, size_t first, std::vector<uint8_t>* known,
               Eigen::Vector3f* x_in_body) {
  for (size_t t = 0; t < known->size(); ++t) {
    (*known)[t] = map.face[first + t] >= 0 ? 1 : 0;
    if ((*known)[t]) x_in_body[t] = AtTexel(body, map, first + t, body.vertices);
  }
}

/// Sums over the pixels of the images.
struct Sums {
  int64_t person = 0, right = 0;
  double uv = 0;
  std::vector<double> ious;
  std::vector<float> distances_m;
};

/// Labels of one image: part (H, W), u and v (2, H, W).
struct Labels {
  const uint8_t* part;
  const float* uv;
};

void AddImage(const Labels& predicted, const Labels& truth, int64_t area, const SurfaceMap& surface, Sums* sums) {
  int64_t both = 0, any = 0;
  for (int64_t p = 0; p < area; ++p) {
    const int part = predicted.part[p], wanted = truth.part[p];
    any += part > 0 || wanted > 0, both += part > 0 && wanted > 0, sums->person += wanted > 0;
    if (part == 0 || wanted == 0) continue;
    const float u = predicted.uv[p], v = predicted.uv[area + p], true_u = truth.uv[p], true_v = truth.uv[area + p];
    if (part == wanted) ++sums->right, sums->uv += (std::abs(u - true_u) + std::abs(v - true_v)) / 2;
    sums->distances_m.push_back((surface.At(part, u, v) - surface.At(wanted, true_u, true_v)).norm());
  }
  if (any > 0) sums->ious.push_back(static_cast<double>(both) / static_cast<double>(any));
}

double Ratio(double sum, int64_t count) { return count > 0 ? sum / static_cast<double>(count) : std::nan(""); }

}  // namespace

SurfaceMap::SurfaceMap(const body::BodyTemplate& body) {
  const body::TexelMap map = body::MapTexels(body, kTexels);
  constexpr size_t kArea = size_t{kTexels} * kTexels;
  x_in_body_.assign(body::kNumParts * kArea, Eigen::Vector3f::Zero());
  std::vector<uint8_t> known(kArea);
  for (size_t part = 0; part < body::kNumParts; ++part) {
    Eigen::Vector3f* chart = x_in_body_.data() + part * kArea;
    FillChart(body, map, part * kArea, &known, chart);
    const std::vector<int64_t> nearest = NearestPixels(kTexels, kTexels, nullptr, known.data());
    for (size_t t = 0; t < kArea; ++t) {
      if (!known[t] && nearest[t] >= 0) chart[t] = chart[nearest[t]];
    }
  }
}

Eigen::Vector3f SurfaceMap::At(int part, double u, double v) const {
  MVS_CHECK(part >= 1 && part <= body::kNumParts, "part " << part);
  const auto texel = [](double c) { return std::clamp(static_cast<int>(c * kTexels), 0, kTexels - 1); };
  return x_in_body_[(static_cast<size_t>(part - 1) * kTexels + static_cast<size_t>(texel(v))) * kTexels +
                    static_cast<size_t>(texel(u))];
}

LabelScore CompareLabels(const at::Tensor& part, const at::Tensor& uv, const PretrainSamples& samples,
                         const std::vector<SurfaceMap>& surfaces) {
  const AvatarPack& pack = samples.pack;
  MVS_CHECK(part.sizes() == pack.part.sizes() && uv.sizes() == pack.uv.sizes(), "labels of other images");
  const int64_t area = int64_t{pack.size_px} * pack.size_px;
  const at::Tensor parts = part.contiguous(), coordinates = uv.contiguous();
  Sums sums;
  for (int64_t i = 0; i < pack.size(); ++i) {
    const auto body_idx = static_cast<size_t>(samples.body_idx[static_cast<size_t>(i)]);
    AddImage({parts.data_ptr<uint8_t>() + i * area, coordinates.data_ptr<float>() + 2 * i * area},
             {pack.part.data_ptr<uint8_t>() + i * area, pack.uv.data_ptr<float>() + 2 * i * area}, area, surfaces.at(body_idx),
             &sums);
  }
  LabelScore score;
  score.samples = pack.size();
  score.part_accuracy = Ratio(static_cast<double>(sums.right), sums.person);
  score.mask_iou = Mean(sums.ious);
  score.uv_error = Ratio(sums.uv, sums.right);
  score.surface_mm = 1e3 * static_cast<double>(UpperMedian(std::move(sums.distances_m)));
  return score;
}

LabelScore ScoreLabels(AvatarModel& model, const PretrainSamples& samples, const std::vector<SurfaceMap>& surfaces) {
  const AvatarPack& pack = samples.pack;
  std::vector<at::Tensor> parts, uvs;
  for (int64_t begin = 0; begin < pack.size(); begin += kBatch) {
    const at::Tensor rows = at::arange(begin, std::min(begin + kBatch, pack.size()), at::kLong);
    const Rendering r = Render(model, PosesOf(pack, rows), pack.size_px, pack.size_px);
    parts.push_back(r.part), uvs.push_back(r.uv);
  }
  return CompareLabels(at::cat(parts), at::cat(uvs), samples, surfaces);
}

}  // namespace mvstudio::avatar
