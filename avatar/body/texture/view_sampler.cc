#include "avatar/body/texture/view_sampler.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace mvstudio::body {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;

bool InsideMask(const Image& mask, const Vector2d& px) {
  constexpr double kReach = 1.5;
  for (const Vector2d& by : {Vector2d(kReach, 0), Vector2d(-kReach, 0), Vector2d(0, kReach), Vector2d(0, -kReach)}) {
    const int x = static_cast<int>(std::lround(px[0] + by[0])), y = static_cast<int>(std::lround(px[1] + by[1]));
    if (x < 0 || y < 0 || x >= mask.width || y >= mask.height || *mask.Pixel(x, y) < 128) return false;
  }
  return true;
}

bool NothingBefore(const PartUvMap& map, const Vector2d& px, double z) {
  constexpr double kTolerance = 0.02;  // m
  const int cx = static_cast<int>(std::lround(px[0])), cy = static_cast<int>(std::lround(px[1]));
  for (int y = cy - 1; y <= cy + 1; ++y) {
    for (int x = cx - 1; x <= cx + 1; ++x) {
      if (x < 0 || y < 0 || x >= map.width || y >= map.height) return false;
      if (map.depth_m[static_cast<size_t>(y) * map.width + x] < z - kTolerance) return false;
    }
  }
  return true;
}

std::array<uint8_t, 3> BilinearColour(const Image& image, const Vector2d& px) {
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

Image WithoutGain(Image image, const Eigen::Array3d& gain) {
  std::array<std::array<uint8_t, 256>, 3> level;
  for (int c = 0; c < 3; ++c) {
    for (int value = 0; value < 256; ++value)
      level[c][value] = static_cast<uint8_t>(std::lround(std::min(255.0, value / gain[c])));
  }
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = level[i % 3][image.pixels[i]];
  return image;
}

geometry::RigCamera FinerCamera(const geometry::RigCamera& camera, int times) {
  geometry::RigCamera fine = camera;
  fine.camera.width_px *= times, fine.camera.height_px *= times;
  fine.camera.params[0] *= times, fine.camera.params[1] *= times;
  for (int k = 2; k < 4; ++k) fine.camera.params[k] = times * (camera.camera.params[k] + 0.5) - 0.5;
  return fine;
}

ViewSampler::ViewSampler(const BodyTemplate& body, const TextureView& view)
    : body_(body),
      view_(view),
      map_(RasterizeBody(body, view.vertices_in_world, view.camera)),
      in_cam_(static_cast<size_t>(view.vertices_in_world.cols())),
      projector_(view.camera.camera) {
  for (size_t i = 0; i < in_cam_.size(); ++i)
    in_cam_[i] = (view.camera.cam_from_world * Vector3d(view.vertices_in_world.col(i).cast<double>())).cast<float>();
}

std::optional<ViewSample> ViewSampler::At(int face, const Vector3f& b) const {
  const Vector3f corner[3] = {in_cam_[body_.faces(0, face)], in_cam_[body_.faces(1, face)], in_cam_[body_.faces(2, face)]};
  const Vector3f x = b[0] * corner[0] + b[1] * corner[1] + b[2] * corner[2];
  if (!(x[2] > 0.01f)) return std::nullopt;
  const Vector3f normal = (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized();
  const float cosine = -normal.dot(x.normalized());
  if (!(cosine > 0.25f)) return std::nullopt;
  const geometry::Projection at = projector_.Project(x.cast<double>());
  if (at.status != Status::kOk || !InsideMask(view_.mask, at.px) || !NothingBefore(map_, at.px, x[2])) return std::nullopt;
  const float near = static_cast<float>(view_.camera.camera.fx()) / x[2];
  return ViewSample{cosine * cosine * near * near, at.px, BilinearColour(view_.image, at.px)};
}

std::optional<Vector2d> ViewSampler::VertexPx(int vertex) const {
  const Vector3f& x = in_cam_[static_cast<size_t>(vertex)];
  if (!(x[2] > 0.01f)) return std::nullopt;
  const geometry::Projection at = projector_.Project(x.cast<double>());
  const bool inside = at.status == Status::kOk && at.px[0] >= 0 && at.px[1] >= 0 && at.px[0] <= view_.image.width - 1 &&
                      at.px[1] <= view_.image.height - 1;
  return inside ? std::optional<Vector2d>(at.px) : std::nullopt;
}

}  // namespace mvstudio::body
