#include "geometry/rig/resize.h"

#include "core/error.h"
#include "core/random.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"

namespace mvstudio::geometry {
namespace {

RigCamera CameraOf(const Camera& lens) {
  RigCamera camera;
  camera.camera = lens;
  return camera;
}

/// Every lens model: a ray's pixel in the new image is that of the old one, cropped and scaled with pixel edges at -0.5.
TEST(Resized, ProjectsWhereThePixelWentInEveryModel) {
  for (const Camera& lens : testing::OrdinaryLenses()) {
    const PixelArea area{37, -12, lens.width_px - 60, lens.height_px + 20};
    const PixelMap map = MapOfArea(area, 2 * area.width_px / 3, 2 * area.height_px / 3);
    const Camera resized = Resized(CameraOf(lens), map, 2 * area.width_px / 3, 2 * area.height_px / 3).camera;
    for (double u : {0.1, 0.5, 0.9}) {
      for (double v : {0.2, 0.5, 0.8}) {
        const Unprojection ray = Unproject(lens, {u * lens.width_px, v * lens.height_px});
        if (ray.status != Status::kOk) continue;
        const Projection before = Project(lens, ray.ray_in_cam), after = Project(resized, ray.ray_in_cam);
        ASSERT_EQ(after.status, Status::kOk) << ToString(lens.model);
        const Eigen::Vector2d expected((before.px.x() - area.x + 0.5) * map.scale_x - 0.5,
                                       (before.px.y() - area.y + 0.5) * map.scale_y - 0.5);
        EXPECT_LT((after.px - expected).norm(), 1e-9) << ToString(lens.model);
      }
    }
  }
}

TEST(Resized, ThereAndBackIsTheSame) {
  const Camera lens = testing::OrdinaryLenses().front();
  const PixelArea all{0, 0, lens.width_px, lens.height_px};
  const RigCamera there =
      Resized(CameraOf(lens), MapOfArea(all, 2 * lens.width_px, 2 * lens.height_px), 2 * lens.width_px, 2 * lens.height_px);
  const PixelArea all_there{0, 0, 2 * lens.width_px, 2 * lens.height_px};
  const RigCamera back = Resized(there, MapOfArea(all_there, lens.width_px, lens.height_px), lens.width_px, lens.height_px);
  EXPECT_LT((back.camera.params - lens.params).norm(), 1e-12 * lens.params.norm());
  EXPECT_EQ(there.camera.cx(), 2 * lens.cx() + 0.5) << "the centre of the top-left pixel is (0, 0)";
}

TEST(ResizeCamera, CarriesTheJointCovariance) {
  Rng rng(2);
  Rig rig;
  const Eigen::Index n = 20;
  Eigen::MatrixXd root(n, n);
  for (Eigen::Index i = 0; i < root.size(); ++i) root.data()[i] = rng.Normal();
  const Eigen::MatrixXd joint = root * root.transpose();
  rig.joint_covariance = joint;
  for (int c = 0; c < 2; ++c) {
    RigCamera camera = CameraOf(MakePinhole("cam" + std::to_string(c), 640, 480, 500));
    camera.params_covariance = joint.block<4, 4>(10 * c, 10 * c);
    camera.cam_from_world_covariance = joint.block<6, 6>(10 * c + 4, 10 * c + 4);
    rig.cameras.push_back(camera);
  }
  ResizeCamera(1, MapOfArea({0, 0, 640, 480}, 1280, 960), 1280, 960, &rig);
  Eigen::VectorXd scales = Eigen::VectorXd::Ones(n);
  scales.segment<4>(10).setConstant(2);
  ASSERT_TRUE(HasJointCovariance(rig)) << "the blocks are those of the joint covariance";
  EXPECT_LT((*rig.joint_covariance - scales.asDiagonal() * joint * scales.asDiagonal()).norm(), 1e-12 * joint.norm());
}

TEST(KeepsAspect, AllowsRoundingAlone) {
  EXPECT_TRUE(KeepsAspect({0, 0, 480, 360}, 960, 720));
  EXPECT_TRUE(KeepsAspect({0, 0, 1920, 1080}, 853, 480)) << "853.33";
  EXPECT_FALSE(KeepsAspect({0, 0, 640, 480}, 1280, 720));
  EXPECT_FALSE(KeepsAspect({0, 0, 1920, 1088}, 1920, 1080));
  EXPECT_THROW(MapOfArea({0, 0, 0, 5}, 3, 3), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::geometry
