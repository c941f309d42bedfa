#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "calib/formats/formats.h"
#include "core/random.h"
#include "geometry/lens/camera.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig.h"
#include "tests/geometry/lens_samples.h"

/// Rigs of every lens for the tests of the calibration formats.
namespace mvstudio::calib::testing {

/// All ordinary lenses with random focal lengths, centres, sizes and places; names "cam0", "cam1", …
inline geometry::Rig RandomRig(uint64_t seed) {
  Rng rng(seed);
  geometry::Rig rig;
  rig.gauge = geometry::RigGauge::Other("test");
  for (geometry::Camera camera : geometry::testing::OrdinaryLenses()) {
    camera.name = "cam" + std::to_string(rig.cameras.size());
    camera.width_px = 1280 + static_cast<int>(rng.Index(8));
    camera.height_px = 960 + static_cast<int>(rng.Index(8));
    const double zoom = rng.Uniform(0.9, 1.3);
    camera.params[0] *= zoom;
    camera.params[1] *= zoom * rng.Uniform(0.99, 1.01);
    camera.params[2] += rng.Uniform(-20, 20);
    camera.params[3] += rng.Uniform(-20, 20);
    geometry::RigCamera placed;
    placed.camera = camera;
    placed.cam_from_world.rotation =
        geometry::RotationExp(Eigen::Vector3d(rng.Uniform(-2, 2), rng.Uniform(-2, 2), rng.Uniform(-2, 2)));
    placed.cam_from_world.translation = {rng.Uniform(-3, 3), rng.Uniform(-3, 3), rng.Uniform(-3, 3)};
    rig.cameras.push_back(placed);
  }
  return rig;
}

/// The cameras of a rig that a format holds exactly; `pick` may leave out more.
template <class Pick>
geometry::Rig Carried(const geometry::Rig& rig, CalibrationFormat format, const Pick& pick) {
  geometry::Rig carried;
  for (const geometry::RigCamera& camera : rig.cameras) {
    if (CanCarry(format, camera.camera) && pick(camera.camera)) carried.cameras.push_back(camera);
  }
  return carried;
}

/// World points in front of both rigs' cameras have the same pixels in cameras of the same position in the list. `b_from_a`
/// takes the first rig's world to the second's.
inline void ExpectSamePixels(const geometry::Rig& a, const geometry::Rig& b, double tolerance_px,
                             const geometry::Rigid3& b_from_a = {}) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  for (size_t i = 0; i < a.cameras.size(); ++i) {
    EXPECT_EQ(a.cameras[i].camera.name, b.cameras[i].camera.name);
    EXPECT_EQ(a.cameras[i].camera.width_px, b.cameras[i].camera.width_px);
    EXPECT_EQ(a.cameras[i].camera.height_px, b.cameras[i].camera.height_px);
    const geometry::Projector first(a.cameras[i].camera), second(b.cameras[i].camera);
    const geometry::Rigid3 world_from_cam = Inverse(a.cameras[i].cam_from_world);
    int compared = 0;
    for (int k = 0; k < 60; ++k) {
      const Eigen::Vector2d px(13 + 120.7 * (k % 10), 7 + 150.3 * (k / 10));
      const geometry::Unprojection ray = first.Unproject(px);
      if (ray.status != Status::kOk) continue;
      const Eigen::Vector3d x_in_world = world_from_cam * Eigen::Vector3d((1.5 + 0.1 * k) * ray.ray_in_cam);
      const geometry::Projection pa = first.Project(a.cameras[i].cam_from_world * x_in_world);
      const geometry::Projection pb = second.Project(b.cameras[i].cam_from_world * (b_from_a * x_in_world));
      ASSERT_EQ(pb.status, Status::kOk) << a.cameras[i].camera.name;
      ASSERT_LT((pa.px - pb.px).norm(), tolerance_px) << a.cameras[i].camera.name << " " << ToString(a.cameras[i].camera.model);
      ++compared;
    }
    EXPECT_GT(compared, 30) << a.cameras[i].camera.name;
  }
}

}  // namespace mvstudio::calib::testing

namespace mvstudio::calib {
using namespace testing;
}
