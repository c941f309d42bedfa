#include "calib/points/colmap_program.h"
#include "calib/points/scene_points.h"
#include "tests/fuzz/fuzz.h"

/// Points of a scene: measured by hand, or found by COLMAP.
namespace mvstudio::fuzz {

MVS_FUZZ_TARGET(scene_points, bytes) {
  const auto parts = Parts(bytes, 2);
  std::vector<std::string> paths = {InMemory("clicks.csv", parts[0])};
  if (!parts[1].empty()) paths.push_back(InMemory("places.csv", parts[1]));
  calib::ScenePoints points;
  if (!Accepts([&] { points = calib::ReadScenePoints(paths); })) return;
  Require(!points.clicks.empty(), "points that nobody sees");
  Require(points.x_in_world.cols() == static_cast<Eigen::Index>(points.names.size()), "a point without a column");
  for (const calib::PointClick& click : points.clicks) {
    Require(click.camera_idx >= 0 && static_cast<size_t>(click.camera_idx) < points.cameras.size(),
            "a camera that is not there");
    Require(click.point_idx >= 0 && static_cast<size_t>(click.point_idx) < points.names.size(), "a point that is not there");
    Require(points.x_in_world.col(click.point_idx).allFinite(), "a clicked point without a place");
  }
}

MVS_FUZZ_TARGET(colmap_scene, bytes) {
  const auto parts = Parts(bytes, 3);
  const std::string folder = ScratchFolder("scene");
  Scratch("scene/cameras.bin", parts[0]);
  Scratch("scene/images.bin", parts[1]);
  Scratch("scene/points3D.bin", parts[2]);
  calib::ColmapScene scene;
  if (!Accepts([&] { scene = calib::ReadColmapScene(folder); })) return;
  for (const calib::ColmapTrackPoint& point : scene.tracks) {
    Require(point.image_idx >= 0 && static_cast<size_t>(point.image_idx) < scene.rig.cameras.size(), "a picture not there");
    Require(point.point_idx >= 0 && point.point_idx < scene.points.cols(), "a point that is not there");
    Require(point.px.allFinite(), "a pixel that is no number");
  }
}

}  // namespace mvstudio::fuzz
