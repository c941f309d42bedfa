#include "body/texture/bake.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "body/mesh_raster.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "geometry/lens/camera.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;

/// Four masks around the pixel say person: no background is mixed in.
bool InsideMask(const Image& mask, const Vector2d& px) {
  constexpr double kReach = 1.5;
  for (const Vector2d& by : {Vector2d(kReach, 0), Vector2d(-kReach, 0), Vector2d(0, kReach), Vector2d(0, -kReach)}) {
    const int x = static_cast<int>(std::lround(px[0] + by[0])), y = static_cast<int>(std::lround(px[1] + by[1]));
    if (x < 0 || y < 0 || x >= mask.width || y >= mask.height || *mask.Pixel(x, y) < 128) return false;
  }
  return true;
}

/// Nothing of the body lies before `z`, and no edge of depth is near.
bool Visible(const std::vector<float>& depth, int width, int height, const Vector2d& px, double z) {
  constexpr double kTolerance = 0.02;  // m
  const int cx = static_cast<int>(std::lround(px[0])), cy = static_cast<int>(std::lround(px[1]));
  for (int y = cy - 1; y <= cy + 1; ++y) {
    for (int x = cx - 1; x <= cx + 1; ++x) {
      if (x < 0 || y < 0 || x >= width || y >= height) return false;
      if (depth[static_cast<size_t>(y) * width + x] < z - kTolerance) return false;
    }
  }
  return true;
}

std::array<uint8_t, 3> Bilinear(const Image& image, const Vector2d& px) {
  const int x = std::clamp(static_cast<int>(px[0]), 0, image.width - 2),
            y = std::clamp(static_cast<int>(px[1]), 0, image.height - 2);
  const double fx = std::clamp(px[0] - x, 0.0, 1.0), fy = std::clamp(px[1] - y, 0.0, 1.0);
  std::array<uint8_t, 3> out;
  for (int c = 0; c < 3; ++c) {
    const double top = (1 - fx) * image.Pixel(x, y)[c] + fx * image.Pixel(x + 1, y)[c];
    const double bottom = (1 - fx) * image.Pixel(x, y + 1)[c] + fx * image.Pixel(x + 1, y + 1)[c];
    out[c] = static_cast<uint8_t>(std::lround((1 - fy) * top + fy * bottom));
  }
  return out;
}

}  // namespace

TextureBaker::TextureBaker(const BodyTemplate& body, int size_px)
    : body_(body), map_(MapTexels(body, size_px)), samples_(map_.face.size() * kSamples) {}

void TextureBaker::AddTexel(const TextureView& view, const std::vector<Vector3f>& in_cam, const std::vector<float>& depth,
                            size_t texel) {
  const int face = map_.face[texel];
  if (face < 0) return;
  const Vector3f corner[3] = {in_cam[body_.faces(0, face)], in_cam[body_.faces(1, face)], in_cam[body_.faces(2, face)]};
  const Vector3f& b = map_.barycentric[texel];
  const Vector3f x = b[0] * corner[0] + b[1] * corner[1] + b[2] * corner[2];
  if (!(x[2] > 0.01f)) return;
  const Vector3f normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized();
  const float cosine = -normal.dot(x.normalized());
  if (!(cosine > 0.25f)) return;
  const geometry::Projector projector(view.camera.camera);
  const geometry::Projection at = projector.Project(x.cast<double>());
  if (at.status != Status::kOk || !InsideMask(view.mask, at.px)) return;
  if (!Visible(depth, view.image.width, view.image.height, at.px, x[2])) return;
  const float near = static_cast<float>(view.camera.camera.fx()) / x[2];
  const Sample sample{cosine * cosine * near * near, view.camera_idx, Bilinear(view.image, at.px)};
  Sample* list = samples_.data() + texel * kSamples;
  Sample* least =
      std::min_element(list, list + kSamples, [](const Sample& a, const Sample& b2) { return a.weight < b2.weight; });
  if (sample.weight > least->weight) *least = sample;
}

void TextureBaker::Add(const TextureView& view, const RunContext& run) {
  num_cameras_ = std::max(num_cameras_, view.camera_idx + 1);
  const PartUvMap map = RasterizeBody(body_, view.vertices_in_world, view.camera);
  std::vector<Vector3f> in_cam(view.vertices_in_world.cols());
  for (size_t i = 0; i < in_cam.size(); ++i)
    in_cam[i] = (view.camera.cam_from_world * Vector3d(view.vertices_in_world.col(i).cast<double>())).cast<float>();
  const size_t chart = static_cast<size_t>(map_.size_px) * map_.size_px;
  ParallelFor(kNumParts, run.num_threads, [&](int64_t part) {
    for (size_t t = 0; t < chart; ++t) AddTexel(view, in_cam, map.depth_m, static_cast<size_t>(part) * chart + t);
  });
}

bool TextureBaker::ColourOf(size_t texel, const std::vector<Eigen::Array3d>& gains, Eigen::Array3d* colour) const {
  constexpr double kLevels = 15;  // samples that differ by more grey levels from the median are doubted
  const Sample* list = samples_.data() + texel * kSamples;
  std::array<Eigen::Array3d, kSamples> values;
  std::array<std::vector<double>, 3> channels;
  for (int k = 0; k < kSamples; ++k) {
    if (!(list[k].weight > 0)) continue;
    for (int c = 0; c < 3; ++c) values[k][c] = list[k].colour[c] / gains[list[k].camera_idx][c];
    for (int c = 0; c < 3; ++c) channels[c].push_back(values[k][c]);
  }
  if (channels[0].empty()) return false;
  Eigen::Array3d median, sum = Eigen::Array3d::Zero();
  for (int c = 0; c < 3; ++c) median[c] = LinearQuantile(channels[c], 0.5);
  double total = 0;
  for (int k = 0; k < kSamples; ++k) {
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
    const Sample* list = samples_.data() + t * kSamples;
    for (int k = 0; k < kSamples; ++k) {
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
  Textures out;
  const int size = map_.size_px;
  const size_t chart = static_cast<size_t>(size) * size;
  std::vector<uint8_t> seen(kNumParts * chart, 0);
  for (int part = 0; part < kNumParts; ++part) {
    out[part] = Image(size, size, 3, 128);
    for (size_t t = 0; t < chart; ++t) {
      Eigen::Array3d colour;
      if (!ColourOf(part * chart + t, gains, &colour)) continue;
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
    for (int k = 0; k < kSamples; ++k)
      if (samples_[t * kSamples + k].weight > 0) {
        ++seen;
        break;
      }
  }
  return all > 0 ? static_cast<double>(seen) / static_cast<double>(all) : 0;
}

RenderedBody RenderBody(const BodyTemplate& body, const Textures& textures, const Eigen::Matrix3Xf& vertices_in_world,
                        const geometry::RigCamera& camera) {
  constexpr int kFiner = 4;
  geometry::RigCamera fine = camera;
  fine.camera.width_px *= kFiner, fine.camera.height_px *= kFiner;
  fine.camera.params[0] *= kFiner, fine.camera.params[1] *= kFiner;
  for (int k = 2; k < 4; ++k) fine.camera.params[k] = kFiner * (camera.camera.params[k] + 0.5) - 0.5;
  const PartUvMap map = RasterizeBody(body, vertices_in_world, fine);
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
            Bilinear(texture, Vector2d(map.u[at] * texture.width - 0.5, map.v[at] * texture.height - 0.5).cwiseMax(0));
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
