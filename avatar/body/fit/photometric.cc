#include "avatar/body/fit/photometric.h"

#include <Eigen/Geometry>
#include <cmath>

#include "avatar/body/mesh_raster.h"
#include "avatar/body/surface_nets.h"
#include "core/check.h"
#include "core/statistics.h"
#include "geometry/lens/camera.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

std::vector<float> Kernel(double sigma_px) {
  const int reach = std::max(1, static_cast<int>(std::ceil(3 * sigma_px)));
  std::vector<float> kernel(2 * reach + 1);
  float sum = 0;
  for (int k = -reach; k <= reach; ++k)
    sum += kernel[k + reach] = static_cast<float>(std::exp(-0.5 * k * k / (sigma_px * sigma_px)));
  for (float& value : kernel) value /= sum;
  return kernel;
}

/// Rows, or columns when `step` is the width. Outside the image: 0.
std::vector<float> Convolve(const std::vector<float>& in, int width, int height, bool along_x,
                            const std::vector<float>& kernel) {
  std::vector<float> out(in.size(), 0);
  const int reach = static_cast<int>(kernel.size() / 2);
  for (int y = 0; y < height; ++y) {
    for (int k = -reach; k <= reach; ++k) {
      const float weight = kernel[k + reach];
      if (along_x) {
        const int x0 = std::max(0, -k), x1 = std::min(width, width - k);
        const float* from = in.data() + static_cast<size_t>(y) * width + k;
        float* to = out.data() + static_cast<size_t>(y) * width;
        for (int x = x0; x < x1; ++x) to[x] += weight * from[x];
      } else if (y + k >= 0 && y + k < height) {
        const float* from = in.data() + static_cast<size_t>(y + k) * width;
        float* to = out.data() + static_cast<size_t>(y) * width;
        for (int x = 0; x < width; ++x) to[x] += weight * from[x];
      }
    }
  }
  return out;
}

}  // namespace

SmoothBrightness::SmoothBrightness(const Image& grey, const Image& mask, double sigma_px)
    : width_(grey.width), height_(grey.height), value_(grey.pixels.size()), cover_(grey.pixels.size()) {
  MVS_CHECK(grey.channels == 1 && mask.channels == 1 && mask.pixels.size() == grey.pixels.size(),
            "image and mask differ in size");
  for (size_t i = 0; i < value_.size(); ++i) {
    cover_[i] = mask.pixels[i] >= 128 ? 1.f : 0.f;
    value_[i] = cover_[i] * static_cast<float>(grey.pixels[i]) / 255;
  }
  const std::vector<float> kernel = Kernel(sigma_px);
  for (std::vector<float>* plane : {&value_, &cover_}) {
    *plane = Convolve(*plane, width_, height_, true, kernel);
    *plane = Convolve(*plane, width_, height_, false, kernel);
  }
  for (size_t i = 0; i < value_.size(); ++i) value_[i] = cover_[i] > 1e-3f ? value_[i] / cover_[i] : 0;
}

bool SmoothBrightness::At(const Vector2d& px, double* value, Eigen::RowVector2d* gradient) const {
  if (!(px[0] >= 1 && px[1] >= 1 && px[0] < width_ - 2 && px[1] < height_ - 2)) return false;
  const int x = static_cast<int>(px[0]), y = static_cast<int>(px[1]);
  const double fx = px[0] - x, fy = px[1] - y;
  const size_t at = static_cast<size_t>(y) * width_ + x;
  const float a = value_[at], b = value_[at + 1], c = value_[at + width_], d = value_[at + width_ + 1];
  if (std::min({cover_[at], cover_[at + 1], cover_[at + width_], cover_[at + width_ + 1]}) < 0.5f) return false;
  *value = (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d);
  *gradient = {(1 - fy) * (b - a) + fy * (d - c), (1 - fx) * (c - a) + fx * (d - b)};
  return true;
}

std::vector<SeenVertex> SeeVertices(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world,
                                    const geometry::RigCamera& camera, const SmoothBrightness& brightness) {
  constexpr double kTolerance = 0.015, kLeastCosine = 0.34;
  const PartUvMap map = RasterizeBody(body, vertices_in_world, camera);
  const Eigen::Matrix3Xf normals = VertexNormals(vertices_in_world, body.faces);
  const geometry::Projector projector(camera.camera);
  const Eigen::Matrix3d rotation = camera.cam_from_world.rotation.toRotationMatrix();
  std::vector<SeenVertex> seen;
  for (Eigen::Index v = 0; v < vertices_in_world.cols(); ++v) {
    const Vector3d x = rotation * vertices_in_world.col(v).cast<double>() + camera.cam_from_world.translation;
    const double cosine = -(rotation * normals.col(v).cast<double>()).dot(x.normalized());
    if (!(x[2] > 1e-3) || !(cosine > kLeastCosine)) continue;
    const geometry::ProjectionWithJacobians projection = projector.ProjectWithJacobians(x);
    if (projection.status != Status::kOk) continue;
    const Vector2d px = projection.px;
    const int cx = static_cast<int>(std::lround(px[0])), cy = static_cast<int>(std::lround(px[1]));
    if (cx < 0 || cy < 0 || cx >= map.width || cy >= map.height) continue;
    if (map.depth_m[static_cast<size_t>(cy) * map.width + cx] < x[2] - kTolerance) continue;
    SeenVertex one;
    Eigen::RowVector2d gradient;
    if (!brightness.At(px, &one.value, &gradient)) continue;
    one.vertex = static_cast<int>(v), one.weight = cosine;
    one.d_value_d_x = gradient * projection.d_px_d_x * rotation;
    seen.push_back(one);
  }
  return seen;
}

MeanBrightness MeanOf(Eigen::Index num_vertices, const std::vector<std::vector<std::vector<SeenVertex>>>& seen) {
  MeanBrightness mean;
  mean.value = mean.weight = Eigen::VectorXd::Zero(num_vertices);
  const auto for_each = [&](const auto& use) {
    for (const auto& step : seen) {
      for (const auto& view : step) {
        for (const SeenVertex& one : view) use(one);
      }
    }
  };
  for_each([&](const SeenVertex& one) {
    const double weight = one.weight * one.weight;
    mean.value[one.vertex] += weight * one.value, mean.weight[one.vertex] += weight;
  });
  mean.value = mean.value.cwiseQuotient(mean.weight.cwiseMax(1e-9)).eval();
  std::vector<double> deviations;
  for_each([&](const SeenVertex& one) { deviations.push_back(std::abs(one.value - mean.value[one.vertex])); });
  constexpr double kLeastSigma = 0.004;  // a grey level
  mean.sigma = std::max(kLeastSigma, kSigmaPerMad * UpperMedian(std::move(deviations), 1.0));
  return mean;
}

}  // namespace mvstudio::body
