#include "avatar/body/texture/bake.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "avatar/body/mesh_raster.h"
#include "avatar/body/texture/weighted_median.h"
#include "core/check.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace mvstudio::body {
using Eigen::Vector2d;

TextureBaker::TextureBaker(const BodyTemplate& body, int size_px, int samples_per_texel)
    : body_(body), map_(MapTexels(body, size_px)), num_samples_(samples_per_texel) {
  MVS_CHECK(size_px >= 2 && samples_per_texel > 0 && samples_per_texel <= kMostSamples,
            "charts of " << size_px << " px with " << samples_per_texel << " samples a texel");
  samples_.resize(map_.face.size() * static_cast<size_t>(num_samples_));
}

void TextureBaker::AddTexel(const ViewSampler& sampler, int camera_idx, size_t texel) {
  const int face = map_.face[texel];
  if (face < 0) return;
  const std::optional<ViewSample> seen = sampler.At(face, map_.barycentric[texel]);
  if (!seen) return;
  Sample* list = samples_.data() + texel * num_samples_;
  Sample* least =
      std::min_element(list, list + num_samples_, [](const Sample& a, const Sample& b) { return a.weight < b.weight; });
  if (seen->weight > least->weight) *least = {seen->weight, camera_idx, seen->colour};
}

void TextureBaker::Add(const TextureView& view, const RunContext& run) {
  num_cameras_ = std::max(num_cameras_, view.camera_idx + 1);
  const ViewSampler sampler(body_, view);
  const size_t chart = static_cast<size_t>(map_.size_px) * map_.size_px;
  ParallelFor(kNumParts, run.num_threads, [&](int64_t part) {
    for (size_t t = 0; t < chart; ++t) AddTexel(sampler, view.camera_idx, static_cast<size_t>(part) * chart + t);
  });
}

bool TextureBaker::MedianOf(size_t texel, const std::vector<Eigen::Array3d>& gains, Eigen::Array3d* colour) const {
  const Sample* list = samples_.data() + texel * num_samples_;
  for (int c = 0; c < 3; ++c) {
    std::vector<std::pair<double, double>> values;
    for (int k = 0; k < num_samples_; ++k) {
      if (list[k].weight > 0) values.emplace_back(list[k].colour[c] / gains[list[k].camera_idx][c], list[k].weight);
    }
    if (values.empty()) return false;
    (*colour)[c] = WeightedMedian(std::move(values));
  }
  return true;
}

bool TextureBaker::ColourOf(size_t texel, const std::vector<Eigen::Array3d>& gains, Eigen::Array3d* colour) const {
  constexpr double kLevels = 15;  // samples that differ by more grey levels from the median are doubted
  const Sample* list = samples_.data() + texel * num_samples_;
  std::array<Eigen::Array3d, kMostSamples> values;
  std::array<std::vector<double>, 3> channels;
  for (int k = 0; k < num_samples_; ++k) {
    if (!(list[k].weight > 0)) continue;
    for (int c = 0; c < 3; ++c) values[k][c] = list[k].colour[c] / gains[list[k].camera_idx][c];
    for (int c = 0; c < 3; ++c) channels[c].push_back(values[k][c]);
  }
  if (channels[0].empty()) return false;
  Eigen::Array3d median, sum = Eigen::Array3d::Zero();
  for (int c = 0; c < 3; ++c) median[c] = LinearQuantile(channels[c], 0.5);
  double total = 0;
  for (int k = 0; k < num_samples_; ++k) {
    if (!(list[k].weight > 0)) continue;
    const double weight = list[k].weight / (1 + (values[k] - median).square().mean() / (kLevels * kLevels));
    sum += weight * values[k], total += weight;
  }
  *colour = sum / total;
  return true;
}

/// One round: medians over the texels of a camera's samples against the colour of all.
std::vector<Eigen::Array3d> TextureBaker::RelativeGains(const std::vector<Eigen::Array3d>& gains) const {
  constexpr double kDark = 16, kBright = 240;  // grey levels between which a ratio says something
  constexpr size_t kFewest = 50;               // texels
  std::vector<std::array<std::vector<double>, 3>> logs(gains.size());
  for (size_t t = 0; t < map_.face.size(); ++t) {
    Eigen::Array3d colour;
    if (!ColourOf(t, gains, &colour)) continue;
    const Sample* list = samples_.data() + t * num_samples_;
    for (int k = 0; k < num_samples_; ++k) {
      for (int c = 0; list[k].weight > 0 && c < 3; ++c) {
        if (list[k].colour[c] >= kDark && list[k].colour[c] <= kBright && colour[c] >= kDark)
          logs[list[k].camera_idx][c].push_back(std::log(list[k].colour[c] / colour[c]));
      }
    }
  }
  std::vector<Eigen::Array3d> out(gains.size(), Eigen::Array3d::Ones());
  for (size_t i = 0; i < gains.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      if (logs[i][c].size() >= kFewest) out[i][c] = std::exp(LinearQuantile(std::move(logs[i][c]), 0.5));
    }
  }
  return out;
}

std::vector<Eigen::Array3d> TextureBaker::Gains() const {
  constexpr int kRounds = 4;
  std::vector<Eigen::Array3d> gains(num_cameras_, Eigen::Array3d::Ones());
  for (int round = 0; round < kRounds && num_cameras_ > 1; ++round) {
    gains = RelativeGains(gains);
    Eigen::Array3d mean = Eigen::Array3d::Zero();
    for (const Eigen::Array3d& gain : gains) mean += gain.log() / num_cameras_;
    for (Eigen::Array3d& gain : gains) gain /= mean.exp();
  }
  return gains;
}

Textures TextureBaker::Finish(const std::vector<Eigen::Array3d>& gains) const {
  return FinishBy(&TextureBaker::ColourOf, gains);
}

Textures TextureBaker::FinishMedian(const std::vector<Eigen::Array3d>& gains) const {
  return FinishBy(&TextureBaker::MedianOf, gains);
}

Textures TextureBaker::FinishBy(ColourRule rule, const std::vector<Eigen::Array3d>& gains) const {
  Textures out;
  const int size = map_.size_px;
  const size_t chart = static_cast<size_t>(size) * size;
  std::vector<uint8_t> seen(kNumParts * chart, 0);
  for (int part = 0; part < kNumParts; ++part) {
    out[part] = Image(size, size, 3, 128);
    for (size_t t = 0; t < chart; ++t) {
      Eigen::Array3d colour;
      if (!(this->*rule)(part * chart + t, gains, &colour)) continue;
      for (int c = 0; c < 3; ++c)
        out[part].pixels[3 * t + c] = static_cast<uint8_t>(std::lround(std::clamp(colour[c], 0.0, 255.0)));
      seen[part * chart + t] = 1;
    }
  }
  FillTexels(std::move(seen), &out);
  return out;
}

double TextureBaker::SeenShare() const {
  int64_t seen = 0, all = 0;
  for (size_t t = 0; t < map_.face.size(); ++t) {
    if (map_.face[t] < 0) continue;
    ++all;
    for (int k = 0; k < num_samples_; ++k)
      if (samples_[t * num_samples_ + k].weight > 0) {
        ++seen;
        break;
      }
  }
  return all > 0 ? static_cast<double>(seen) / static_cast<double>(all) : 0;
}

RenderedBody RenderBody(const BodyTemplate& body, const Textures& textures, const Eigen::Matrix3Xf& vertices_in_world,
                        const geometry::RigCamera& camera) {
  constexpr int kFiner = 4;
  const PartUvMap map = RasterizeBody(body, vertices_in_world, FinerCamera(camera, kFiner));
  RenderedBody out{Image(camera.camera.width_px, camera.camera.height_px, 3),
                   Image(camera.camera.width_px, camera.camera.height_px, 1)};
  for (int y = 0; y < out.image.height; ++y) {
    for (int x = 0; x < out.image.width; ++x) {
      double sum[3] = {0, 0, 0};
      int count = 0;
      for (int k = 0; k < kFiner * kFiner; ++k) {
        const size_t at = static_cast<size_t>(y * kFiner + k / kFiner) * map.width + x * kFiner + k % kFiner;
        if (map.part[at] == 0) continue;
        const Image& texture = textures[map.part[at] - 1];
        const auto colour =
            BilinearColour(texture, Vector2d(map.u[at] * texture.width - 0.5, map.v[at] * texture.height - 0.5).cwiseMax(0));
        for (int c = 0; c < 3; ++c) sum[c] += colour[c];
        ++count;
      }
      for (int c = 0; c < 3; ++c) out.image.Pixel(x, y)[c] = static_cast<uint8_t>(std::lround(sum[c] / (kFiner * kFiner)));
      *out.cover.Pixel(x, y) = static_cast<uint8_t>(std::lround(255.0 * count / (kFiner * kFiner)));
    }
  }
  return out;
}

}  // namespace mvstudio::body
