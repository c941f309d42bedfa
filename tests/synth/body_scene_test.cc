#include "synth/body_scene.h"

#include <cmath>

#include "synth/detections.h"
#include "synth/motion.h"
#include "synth/studio.h"
#include "tests/support/test.h"

namespace mvstudio::synth {
namespace {

struct World {
  body::BodyTemplate body = body::MakeMannequin();
  std::array<Image, body::kNumParts> textures = body::MannequinTextures(64, 1);
  geometry::Rig rig = MakeStudio(SynthOptions{}, 1);
};

const World& TheWorld() {
  static const World world;
  return world;
}

TEST(BodyScene, RayCastingAgreesWithRasterisation) {
  const World& world = TheWorld();
  const Eigen::Matrix3Xf vertices = body::SkinVertices(world.body, PersonPose(world.body, 1.3, 1));
  const BodyScene scene(world.body, world.textures, vertices);
  for (int c : {0, 3}) {
    const geometry::RigCamera& camera = world.rig.cameras[c];
    Image image(640, 480, 3, 100);
    const BodyScene::Truth truth = scene.Draw(camera, LensRays(camera), 1, &image);
    const body::PartUvMap map = body::RasterizeBody(world.body, vertices, camera);
    int both = 0, either = 0, same_part = 0, same_uv = 0;
    for (size_t i = 0; i < truth.part.size(); ++i) {
      either += truth.part[i] || map.part[i];
      if (!truth.part[i] || !map.part[i]) continue;
      ++both;
      if (truth.part[i] != map.part[i]) continue;
      ++same_part;
      same_uv += std::abs(truth.u[i] - 255 * map.u[i]) < 2 && std::abs(truth.v[i] - 255 * map.v[i]) < 2;
    }
    EXPECT_GT(both, 12000);
    EXPECT_GT(both, 0.998 * either);
    EXPECT_GT(same_part, 0.995 * both);
    EXPECT_GT(same_uv, 0.99 * same_part);
  }
}

TEST(BodyScene, JointsProjectIntoTheMask) {
  const World& world = TheWorld();
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25");
  for (double time_s : {0.0, 1.1, 2.9}) {
    const body::BodyPose pose = PersonPose(world.body, time_s, 1);
    const BodyScene scene(world.body, world.textures, body::SkinVertices(world.body, pose));
    const Eigen::Matrix3Xd joints = PersonJoints(world.body, pose, skeleton);
    for (int c : {1, 4}) {
      const geometry::RigCamera& camera = world.rig.cameras[c];
      Image image(640, 480, 3, 100);
      const BodyScene::Truth truth = scene.Draw(camera, LensRays(camera), 1, &image);
      for (int j = 0; j < joints.cols(); ++j) {
        const geometry::Projection p = geometry::Project(camera.camera, camera.cam_from_world * Eigen::Vector3d(joints.col(j)));
        if (p.status != Status::kOk || !geometry::InImage(camera.camera, p.px)) continue;
        const size_t at = static_cast<size_t>(std::lround(p.px[1])) * 640 + std::lround(p.px[0]);
        EXPECT_GT(truth.part[at], 0) << skeleton.joints[j] << " at " << time_s << " s in camera " << c;
      }
    }
  }
}

TEST(BodyScene, EdgesAreBlendedWithTheBackground) {
  const World& world = TheWorld();
  const BodyScene scene(world.body, world.textures, body::SkinVertices(world.body, PersonPose(world.body, 0, 1)));
  const geometry::RigCamera& camera = world.rig.cameras[0];
  const LensRays rays(camera);
  Image black(640, 480, 3, 0), white(640, 480, 3, 255);
  scene.Draw(camera, rays, 3, &black);
  scene.Draw(camera, rays, 3, &white);
  int partial = 0;
  for (size_t i = 0; i < black.pixels.size(); i += 3) {
    const int background = white.pixels[i] - black.pixels[i];  // 255 times the uncovered fraction
    EXPECT_GE(background, 0);
    const double ninths = background / 255.0 * 9;
    EXPECT_NEAR(ninths, std::round(ninths), 0.06);
    partial += background > 0 && background < 255;
  }
  EXPECT_GT(partial, 300);
}

TEST(DetectJoints, NoiseHasTheStatedSizeAndHiddenFacesAreNotSeen) {
  const World& world = TheWorld();
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25");
  double sum = 0, sum2 = 0;
  int count = 0, hidden = 0, noses = 0;
  for (int f = 0; f < 20; ++f) {
    const body::BodyPose pose = PersonPose(world.body, 0.2 * f, 1);
    const BodyScene scene(world.body, world.textures, body::SkinVertices(world.body, pose));
    const Eigen::Matrix3Xd joints = PersonJoints(world.body, pose, skeleton);
    for (const geometry::RigCamera& camera : world.rig.cameras) {
      const dataset::Person2d person =
          DetectJoints(scene, camera, skeleton, joints, 0.7, 10 * f + 1 + (&camera - world.rig.cameras.data()) * 1000);
      ASSERT_EQ(person.keypoints.size(), 25u);
      for (int j = 0; j < 25; ++j) {
        const dataset::Keypoint2d& point = person.keypoints[j];
        if (point.score == 0) continue;
        const Eigen::Vector2d px = geometry::Project(camera.camera, camera.cam_from_world * Eigen::Vector3d(joints.col(j))).px;
        for (double r : {point.x_px - px[0], point.y_px - px[1]}) sum += r, sum2 += r * r, ++count;
        hidden += point.score < 0.5;
      }
      const Eigen::Vector3d forward = pose.bone_transforms[4].rotation * -Eigen::Vector3d::UnitY();
      const Eigen::Vector3d view = (camera.CenterInWorld() - joints.col(0)).normalized();
      if (forward.dot(view) < -0.6) {
        EXPECT_EQ(person.keypoints[0].score, 0) << "a nose seen from behind";
      }
      noses += forward.dot(view) > 0.6 && person.keypoints[0].score > 0.5;
    }
  }
  EXPECT_NEAR(sum / count, 0, 0.05);
  EXPECT_NEAR(std::sqrt(sum2 / count), 0.7, 0.03);
  EXPECT_GT(hidden, 20);
  EXPECT_GT(noses, 15);
}

}  // namespace
}  // namespace mvstudio::synth
