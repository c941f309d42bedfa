#include "avatar/splats/render.h"

#include <algorithm>
#include <cmath>

#include "avatar/splats/bend.h"
#include "core/check.h"

namespace mvstudio::splats {
namespace {

Cloud BentOn(const body::BodyTemplate& body, const Eigen::Matrix3Xf& vertices, const Cloud& cloud) {
  CheckCloud(cloud, static_cast<int>(body.faces.cols()));
  const Eigen::Matrix2Xi bones = BonesOfFaces(body);
  return Bent(cloud, Bending<float>{bones, BoneTurns(body, vertices)});
}

}  // namespace

Rendered RenderSplats(const Cloud& cloud, const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& vertices_in_world,
                      const geometry::RigCamera& camera, const RenderSettings& settings) {
  CheckCloud(cloud, static_cast<int>(faces.cols()));
  MVS_CHECK(!cloud.values.bends, "a corrective of poses needs the body: RenderGaussians");
  MVS_CHECK(faces.size() == 0 || (faces.minCoeff() >= 0 && faces.maxCoeff() < vertices_in_world.cols()),
            "faces of a mesh with more than " << vertices_in_world.cols() << " vertices");
  const PinholeView<float> view = ViewOf<float>(camera);
  const Projected<float> projected = ProjectSplats(cloud, {faces, vertices_in_world}, view, settings);
  const Tiles tiles = BinSplats(projected.splats, view.width, view.height);
  Rendered out;
  out.image = Rasterise(projected.splats, tiles, view.width, view.height, settings.num_threads);
  out.skipped = projected.skipped;
  out.shown = static_cast<int64_t>(projected.splats.size());
  return out;
}

body::RenderedBody RenderGaussians(const Cloud& cloud, const body::BodyTemplate& body,
                                   const Eigen::Matrix3Xf& vertices_in_world, const geometry::RigCamera& camera,
                                   const RenderSettings& settings) {
  const Rendered rendered = RenderSplats(cloud.values.bends ? BentOn(body, vertices_in_world, cloud) : cloud, body.faces,
                                         vertices_in_world, camera, settings);
  const RasterImage<float>& image = rendered.image;
  body::RenderedBody out{Image(image.width, image.height, 3), Image(image.width, image.height, 1)};
  const auto byte = [](float value) { return static_cast<uint8_t>(std::lround(255 * std::clamp(value, 0.f, 1.f))); };
  for (size_t i = 0; i < image.area(); ++i) {
    for (int c = 0; c < 3; ++c) out.image.pixels[3 * i + static_cast<size_t>(c)] = byte(image.Plane(c)[i]);
    out.cover.pixels[i] = byte(image.Plane(3)[i]);
  }
  return out;
}

}  // namespace mvstudio::splats
