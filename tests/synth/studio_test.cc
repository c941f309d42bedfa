#include "synth/studio.h"

#include "core/error.h"
#include "core/random.h"
#include "synth/lens_rays.h"
#include "tests/support/test.h"

namespace mvstudio::synth {
namespace {

TEST(MakeStudio, EveryLensCanBeInvertedOverTheWholeImage) {
  for (geometry::LensModel model : geometry::ModelsSimplestFirst()) {
    for (const Arrangement arrangement : {Arrangement::kRing, Arrangement::kDome}) {
      SynthOptions options;
      options.lens = geometry::ToString(model);
      options.arrangement = arrangement;
      const geometry::Rig rig = MakeStudio(options, 3);
      ASSERT_EQ(rig.cameras.size(), 8u);
      for (const geometry::RigCamera& camera : rig.cameras) {
        geometry::Validate(camera.camera);
        const geometry::Projector projector(camera.camera);
        for (double x : {-0.5, 320.0, 639.5}) {
          for (double y : {-0.5, 240.0, 479.5}) EXPECT_EQ(projector.Unproject({x, y}).status, Status::kOk) << options.lens;
        }
        const geometry::Projection center = projector.Project(camera.cam_from_world * Eigen::Vector3d(0, 0, 1));
        EXPECT_EQ(center.status, Status::kOk);
        EXPECT_LT((center.px - Eigen::Vector2d(320, 240)).norm(), 60);
        EXPECT_LT(projector.Project(camera.cam_from_world * Eigen::Vector3d(0, 0, 1.7)).px[1], center.px[1]);
      }
    }
  }
}

TEST(MakeStudio, CamerasStandWhereTheyWereAskedForAndDifferWithTheSeed) {
  SynthOptions options;
  options.cameras = 5;
  options.radius_m = 2;
  const geometry::Rig a = MakeStudio(options, 1), b = MakeStudio(options, 2), c = MakeStudio(options, 1);
  EXPECT_EQ(a.cameras[0].camera.name, "cam_01");
  for (size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(a.cameras[i].CenterInWorld().head<2>().norm(), 2, 0.1);
    EXPECT_EQ(a.cameras[i].camera.params, c.cameras[i].camera.params);
    EXPECT_NE(a.cameras[i].camera.params, b.cameras[i].camera.params);
  }
}

TEST(SynthOptions, NonsenseIsRefusedByName) {
  auto refused = [](const std::string& name, auto change) {
    SynthOptions options;
    try {
      change(options);
      Validate(options);
    } catch (const UsageError& error) {
      return std::string(error.what()).find(name) != std::string::npos;
    }
    return false;
  };
  EXPECT_TRUE(refused("option 'size'", [](auto& o) { o.size = "640"; }));
  EXPECT_TRUE(refused("option 'size'", [](auto& o) { o.size = "641x480"; }));
  EXPECT_TRUE(refused("option 'size'", [](auto& o) { o.size = "640x480x3"; }));
  EXPECT_TRUE(refused("option 'lens'", [](auto& o) { o.lens = "fisheye"; }));
  EXPECT_TRUE(refused("option 'lens'", [](auto& o) { o.lens = "splined"; }));
  EXPECT_TRUE(refused("option 'arrangement'", [](auto& o) { FromString("line", &o.arrangement); }));
  EXPECT_TRUE(refused("option 'cameras'", [](auto& o) { o.cameras = 0; }));
  EXPECT_TRUE(refused("option 'noise-px'", [](auto& o) { o.noise_px = -1; }));
  EXPECT_TRUE(refused("option 'samples'", [](auto& o) { o.samples = 0; }));
  EXPECT_TRUE(refused("board", [](auto& o) { o.board = "charuco"; }));
  EXPECT_TRUE(refused("option 'format'", [](auto& o) { FromString("avi", &o.format); }));
  EXPECT_TRUE(refused("option 'background'", [](auto& o) { FromString("blue", &o.background); }));
  EXPECT_TRUE(refused("option 'fps'", [](auto& o) { o.fps = 0; }));
}

TEST(LensRays, GoThroughTheExactLens) {
  for (const geometry::LensModel lens_model : geometry::ModelsSimplestFirst()) {
    const std::string lens(ToString(lens_model));
    SynthOptions options;
    options.lens = lens;
    const geometry::RigCamera camera = MakeStudio(options, 5).cameras[2];
    const geometry::Projector projector(camera.camera);
    const LensRays rays(camera);
    Rng rng(1);
    for (int trial = 0; trial < 2000; ++trial) {
      const int x = static_cast<int>(rng.Index(640)), y = static_cast<int>(rng.Index(480));
      const double dx = rng.Uniform(-0.5, 0.5), dy = rng.Uniform(-0.5, 0.5);
      const Eigen::Vector3d at = rays.origin().cast<double>() + 3 * rays.Direction(x, y, dx, dy).cast<double>();
      const geometry::Projection p = projector.Project(camera.cam_from_world * at);
      ASSERT_EQ(p.status, Status::kOk);
      EXPECT_LT((p.px - Eigen::Vector2d(x + dx, y + dy)).norm(), 3e-4) << lens;
    }
  }
}

}  // namespace
}  // namespace mvstudio::synth
