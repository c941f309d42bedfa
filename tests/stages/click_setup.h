#pragma once

#include <string>

#include "core/random.h"
#include "geometry/lens/camera.h"
#include "geometry/rigid/rigid3.h"
#include "stages/click/click_scene.h"

namespace mvstudio::testing {}

/// Twelve points on two walls and one camera, "a", that sees them all.
namespace mvstudio::stages::testing {

using namespace mvstudio::testing;  // `testing::TempDir` means the same in every test of stages

inline geometry::Camera ClickLens() { return geometry::MakePinhole("a", 640, 480, 500); }

inline geometry::Rigid3 CamFromWalls() {
  geometry::Rigid3 cam_from_world;
  cam_from_world.rotation = geometry::RotationExp(Eigen::Vector3d(0.1, -0.2, 0.05));
  cam_from_world.translation = Eigen::Vector3d(-0.3, 0.1, 4);
  return cam_from_world;
}

inline calib::ScenePoints Walls() {
  calib::ScenePoints points;
  points.x_in_world.resize(3, 12);
  for (int i = 0; i < 12; ++i) {
    points.names.push_back("p" + std::to_string(i + 1));
    points.x_in_world.col(i) = Eigen::Vector3d(0.5 * (i % 4) - 0.7, 0.5 * (i / 4) - 0.5, i % 2 ? 0.8 : 0.0);
  }
  return points;
}

inline Eigen::Vector2d TruePx(int point) {
  const calib::ScenePoints points = Walls();
  return geometry::Project(ClickLens(), CamFromWalls() * Eigen::Vector3d(points.x_in_world.col(point))).px;
}

/// A bright dot of 5 x 5 px at each point; the camera a knows its lens, the second one, b, does not.
inline Image DotsImage() {
  Image image(640, 480, 3, 60);
  for (int p = 0; p < 12; ++p) {
    const Eigen::Vector2d px = TruePx(p);
    for (int y = -2; y <= 2; ++y) {
      for (int x = -2; x <= 2; ++x) {
        uint8_t* at = image.Pixel(static_cast<int>(std::lround(px.x())) + x, static_cast<int>(std::lround(px.y())) + y);
        at[0] = at[1] = at[2] = 240;
      }
    }
  }
  return image;
}

inline ClickScene WallScene() {
  ClickScene scene;
  AddCamera("a", DotsImage(), ClickLens(), &scene);
  AddCamera("b \"2\"", Image(320, 240, 3, 90), std::nullopt, &scene);
  AddPoints(Walls(), &scene);
  return scene;
}

}  // namespace mvstudio::stages::testing

namespace mvstudio::stages {
using namespace testing;
}
