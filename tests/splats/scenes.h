#pragma once

#include <Eigen/Core>
#include <vector>

#include "avatar/splats/raster.h"
#include "core/random.h"

/// Small scenes for tests of Gaussians.
namespace mvstudio::splats::testing {

/// Triangles in space and Gaussians on them, in double.
struct Scene {
  Eigen::Matrix3Xi faces;
  Eigen::Matrix<double, 3, Eigen::Dynamic> vertices;
  BasicCloud<double> cloud;
  geometry::RigCamera camera;

  Surface<double> surface() const { return {faces, vertices}; }
  PinholeView<double> view() const { return ViewOf<double>(camera); }
};

inline geometry::RigCamera CameraOf(int width, int height, double focal_px) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("cam", width, height, focal_px);
  return camera;
}

/// `n` Gaussians, each on a triangle of its own about 2 m before a camera that is turned; seeded.
inline Scene RandomScene(size_t n, int degree, uint64_t seed, int width = 26, int height = 21) {
  Rng rng(seed);
  Scene scene;
  scene.camera = CameraOf(width, height, 30);
  scene.camera.cam_from_world = {geometry::RotationExp({0.2, -0.3, 0.1}), {0.1, -0.05, 0.2}};
  const geometry::Rigid3 world_from_cam = geometry::Inverse(scene.camera.cam_from_world);
  scene.faces.resize(3, static_cast<Eigen::Index>(n)), scene.vertices.resize(3, static_cast<Eigen::Index>(3 * n));
  scene.cloud.values = ZeroParameters<double>(n, degree);
  for (size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d middle(rng.Uniform(-0.6, 0.6), rng.Uniform(-0.5, 0.5), rng.Uniform(1.6, 2.4));
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d x = middle + 0.1 * Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal());
      scene.vertices.col(static_cast<Eigen::Index>(3 * i) + k) = world_from_cam * x;
      scene.faces(k, static_cast<Eigen::Index>(i)) = static_cast<int>(3 * i) + k;
    }
    scene.cloud.face.push_back(static_cast<int>(i));
    scene.cloud.filter_variance.push_back(1e-4 * rng.Uniform());
    Parameters<double>& v = scene.cloud.values;
    v.place[2 * i] = rng.Uniform(0.1, 0.5), v.place[2 * i + 1] = rng.Uniform(0.1, 0.5), v.offset[i] = 0.05 * rng.Normal();
    for (size_t k = 0; k < 3; ++k) v.log_scale[3 * i + k] = std::log(rng.Uniform(0.03, 0.2));
    for (size_t k = 0; k < 4; ++k) v.rotation[4 * i + k] = rng.Normal();
    v.opacity[i] = rng.Uniform(-2, 2);
    const size_t width_of = 3 * static_cast<size_t>(BasisSize(degree));
    for (size_t k = 0; k < width_of; ++k) v.colour[width_of * i + k] = 0.4 * rng.Normal();
  }
  return scene;
}

/// One Gaussian on a triangle that faces the camera at `depth` metres, at pixel (x, y), round with a standard deviation of
/// `sigma` metres; the camera has a focal length of 100 px.
inline Scene FacingScene(int size_px, const std::vector<Eigen::Vector3d>& x_y_depth, double sigma) {
  Scene scene;
  const size_t n = x_y_depth.size();
  scene.camera = CameraOf(size_px, size_px, 100);
  scene.faces.resize(3, static_cast<Eigen::Index>(n)), scene.vertices.resize(3, static_cast<Eigen::Index>(3 * n));
  scene.cloud.values = ZeroParameters<double>(n, 0);
  scene.cloud.filter_variance.assign(n, 0);
  for (size_t i = 0; i < n; ++i) {
    const double z = x_y_depth[i][2], centre = 0.5 * (size_px - 1);
    const Eigen::Vector3d middle((x_y_depth[i][0] - centre) / 100 * z, (x_y_depth[i][1] - centre) / 100 * z, z);
    const Eigen::Vector3d corners[3] = {{0, 0, 0}, {0, 0.1, 0}, {0.1, 0, 0}};
    for (int k = 0; k < 3; ++k) {
      scene.vertices.col(static_cast<Eigen::Index>(3 * i) + k) = middle + corners[k];
      scene.faces(k, static_cast<Eigen::Index>(i)) = static_cast<int>(3 * i) + k;
    }
    scene.cloud.face.push_back(static_cast<int>(i));
    for (size_t k = 0; k < 3; ++k) scene.cloud.values.log_scale[3 * i + k] = std::log(sigma);
    scene.cloud.values.rotation[4 * i + 3] = 1;
  }
  return scene;
}

template <class S>
struct Drawn {
  Projected<S> projected;
  Tiles tiles;
  RasterImage<S> image;
};

template <class S>
Drawn<S> Draw(const BasicCloud<S>& cloud, const Surface<S>& surface, const PinholeView<S>& view,
              const RenderSettings& settings) {
  Drawn<S> out;
  out.projected = ProjectSplats(cloud, surface, view, settings);
  out.tiles = BinSplats(out.projected.splats, view.width, view.height);
  out.image = Rasterise(out.projected.splats, out.tiles, view.width, view.height, settings.num_threads);
  return out;
}

inline Drawn<double> Draw(const Scene& scene, const RenderSettings& settings = {}) {
  return Draw(scene.cloud, scene.surface(), scene.view(), settings);
}

}  // namespace mvstudio::splats::testing

namespace mvstudio::splats {
using namespace testing;
}
