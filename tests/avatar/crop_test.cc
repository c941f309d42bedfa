#include "dataset/views/crop.h"

#include <limits>

#include "avatar/body/mesh_raster.h"
#include "avatar/run/pack/shape_fit.h"
#include "core/error.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

using dataset::CropCamera;
using dataset::Resample;

dataset::Coco19Pose MannequinJoints() {
  dataset::Coco19Pose pose;
  pose.x_in_world = body::MakeMannequin(1.75, 0.3).coco19;
  pose.valid.fill(true);
  return pose;
}

TEST(Crop, LooksAtThePersonAndKeepsAMetreTheSameSize) {
  for (int index = 0; index < 5; ++index) {
    const geometry::RigCamera camera = RingCamera(index, 5, 400);
    const Eigen::Vector3d middle(0.4, -0.3, 2.0 + index);
    const geometry::RigCamera crop = CropCamera(camera, middle, 1.2, 0.9, 128);
    const geometry::Rigid3 crop_from_cam = crop.cam_from_world * geometry::Inverse(camera.cam_from_world);
    EXPECT_LT(crop_from_cam.translation.norm(), 1e-12) << "same place";
    const Eigen::Vector3d looked_at = crop_from_cam * middle;
    EXPECT_NEAR(geometry::Project(crop.camera, looked_at).px[0], 63.5, 1e-9);
    EXPECT_NEAR(geometry::Project(crop.camera, looked_at).px[1], 63.5, 1e-9);
    const Eigen::Vector2d edge = geometry::Project(crop.camera, looked_at + Eigen::Vector3d(1.2, 0, 0)).px;
    EXPECT_NEAR(edge[0], 63.5 + 0.9 * 64, 1e-9);
  }
}

TEST(Crop, MeasuresTheJointsAndTheirThickness) {
  const geometry::RigCamera camera = RingCamera(0, 4, 400);
  const auto extent = MeasurePerson(MannequinJoints(), camera);
  ASSERT_TRUE(extent.has_value());
  const geometry::RigCamera crop = CropCamera(camera, extent->middle_in_cam, extent->half_extent_m, 1.0, 200);
  const body::BodyTemplate body = body::MakeMannequin(1.75, 0.3);
  const body::BodyPose rest = SwingPose(body, 0);
  const body::PartUvMap map = body::RasterizeBody(body, body::SkinVertices(body, rest), crop);
  int low = 200, high = 0;
  for (int i = 0; i < 200 * 200; ++i) {
    if (map.part[i]) low = std::min(low, i / 200), high = std::max(high, i / 200);
  }
  EXPECT_GT(low, 0);
  EXPECT_LT(high, 199);
  EXPECT_GT(high - low, 170) << "the whole body, and it fills the crop";
}

TEST(Crop, LeavesOutWrongJoints) {
  dataset::Coco19Pose pose = MannequinJoints();
  const auto before = MeasurePerson(pose, RingCamera(0, 4, 400));
  pose.x_in_world.col(5) = Eigen::Vector3d(0, 0, 40);
  pose.x_in_world(0, 8) = std::numeric_limits<double>::quiet_NaN();
  const std::array<bool, 19> plausible = PlausibleJoints(pose);
  EXPECT_FALSE(plausible[5]);
  EXPECT_FALSE(plausible[8]);
  EXPECT_TRUE(plausible[4]);
  const auto after = MeasurePerson(pose, RingCamera(0, 4, 400));
  ASSERT_TRUE(after.has_value());
  EXPECT_NEAR(after->half_extent_m, before->half_extent_m, 0.2);
  pose.valid.fill(false);
  EXPECT_FALSE(MeasurePerson(pose, RingCamera(0, 4, 400)).has_value());
}

TEST(Crop, NothingBehindTheCamera) {
  dataset::Coco19Pose pose = MannequinJoints();
  pose.x_in_world.row(1).array() -= 5;  // the camera stands at y = -3 and looks along +y
  EXPECT_FALSE(MeasurePerson(pose, RingCamera(0, 4, 400)).has_value());
}

// An image whose colours are its own pixel coordinates.
Image CoordinateImage(int size) {
  Image image(size, size, 3);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x)
      image.Pixel(x, y)[0] = static_cast<uint8_t>(x), image.Pixel(x, y)[1] = static_cast<uint8_t>(y);
  }
  return image;
}

TEST(Resample, ReadsThroughTheExactLens) {
  const geometry::RigCamera camera = RingCamera(1, 5, 240);
  const geometry::RigCamera crop = CropCamera(camera, {0.2, 0.1, 3.0}, 0.9, 1.0, 96);
  const Image out = Resample(CoordinateImage(240), camera, crop);
  const geometry::Projector crop_lens(crop.camera);
  const geometry::Rigid3 cam_from_crop = camera.cam_from_world * geometry::Inverse(crop.cam_from_world);
  double worst = 0;
  for (int y = 2; y < 94; y += 7) {
    for (int x = 2; x < 94; x += 7) {
      const Eigen::Vector3d ray = cam_from_crop.rotation * crop_lens.Unproject({x, y}).ray_in_cam;
      const Eigen::Vector2d expected = geometry::Project(camera.camera, ray).px;
      if (expected.minCoeff() < 2 || expected.maxCoeff() > 237) continue;
      worst = std::max({worst, std::abs(out.Pixel(x, y)[0] - expected[0]), std::abs(out.Pixel(x, y)[1] - expected[1])});
    }
  }
  EXPECT_LT(worst, 0.56) << "half a level of rounding and the bend of the lens within a pixel";
}

TEST(Resample, AveragesOverTheFootprintWhenShrinking) {
  const geometry::RigCamera camera = RingCamera(0, 4, 400);
  Image checker(400, 400, 1);
  for (int i = 0; i < 400 * 400; ++i) checker.pixels[i] = (i % 400 + i / 400) % 2 ? 255 : 0;
  const Image out = Resample(checker, camera, CropCamera(camera, {0, 0, 3}, 0.8, 1.0, 32));
  for (int y = 2; y < 30; ++y) {
    for (int x = 2; x < 30; ++x) ASSERT_NEAR(out.Pixel(x, y)[0], 127.5, 30) << x << " " << y;
  }
}

TEST(Resample, KeepsConstantsAndIsBlackOutside) {
  const geometry::RigCamera camera = RingCamera(0, 4, 100);
  const Image out = Resample(Image(100, 100, 3, 77), camera, CropCamera(camera, {0, 0, 3}, 4.0, 1.0, 64));
  EXPECT_EQ(out.Pixel(32, 32)[1], 77);
  EXPECT_EQ(out.Pixel(1, 1)[1], 0);
  EXPECT_THROW(Resample(Image(99, 100, 3), camera, camera), ContractViolation);
}

TEST(BodyShape, OneKeepsTheTemplateAndGirthScalesAcrossTheBone) {
  const body::BodyTemplate body = body::MakeMannequin(1.75, 0.4);
  EXPECT_EQ(ScaleGirth(body, {}).vertices, body.vertices);
  BodyShape thick;
  thick.girth[kLegGirth] = 1.5;
  const body::BodyTemplate scaled = ScaleGirth(body, thick);
  double before = 0, after = 0;
  int count = 0;
  const Eigen::Vector3f knee = body.coco19.col(7).cast<float>(), hip = body.coco19.col(6).cast<float>(),
                        axis = (knee - hip).normalized();
  for (Eigen::Index i = 0; i < body.vertices.cols(); ++i) {
    const Eigen::Vector3f d = body.vertices.col(i) - hip;
    const float along = d.dot(axis) / (knee - hip).norm();
    if (along < 0.4f || along > 0.6f || (d - axis * d.dot(axis)).norm() > 0.12f) continue;  // the middle of the left thigh
    const Eigen::Vector3f e = scaled.vertices.col(i) - hip;
    before += (d - axis * d.dot(axis)).norm(), after += (e - axis * e.dot(axis)).norm(), ++count;
  }
  ASSERT_GT(count, 20);
  EXPECT_NEAR(after / before, 1.5, 0.02);
  EXPECT_EQ(GroupOfPart(1), kTrunkGirth);
  EXPECT_EQ(GroupOfPart(4), kArmGirth);
  EXPECT_EQ(GroupOfPart(5), kLegGirth);
  EXPECT_EQ(GroupOfPart(24), kHeadGirth);
  EXPECT_THROW(GroupOfPart(0), ContractViolation);
}

TEST(ShapeFit, FindsAKnownGirth) {
  const body::BodyTemplate body = body::MakeMannequin(1.75, 0.3);
  BodyShape truth;
  truth.girth = {1.2, 1.1, 0.85, 1.3};
  const body::BodyTemplate person = ScaleGirth(body, truth);
  std::vector<ShapeView> views;
  for (int i = 0; i < 6; ++i) {
    const body::BodyPose pose = SwingPose(body, 0.3 * i);
    const geometry::RigCamera crop = CropCamera(RingCamera(i, 6, 400), {0, 0, 3}, 1.1, 1.0, 128);
    const body::PartUvMap map = body::RasterizeBody(person, body::SkinVertices(person, pose), crop);
    Image mask(128, 128, 1);
    for (size_t k = 0; k < map.part.size(); ++k) mask.pixels[k] = map.part[k] ? 255 : 0;
    views.push_back({pose, crop, mask});
  }
  const ShapeFit fit = FitShape(body, {}, views, {});
  EXPECT_LT(fit.iou_before, 0.9);
  EXPECT_GT(fit.iou, 0.985);
  for (int g = 0; g < kNumGirthGroups; ++g) EXPECT_NEAR(fit.shape.girth[g], truth.girth[g], 0.04) << g;
}

}  // namespace
}  // namespace mvstudio::avatar
