#include <array>
#include <cmath>

#include "stages/overlay/draw_view.h"
#include "tests/support/test.h"

/// A joint of known place must be coloured where the lens's own formula, written out here, puts it.
namespace mvstudio::stages {
namespace {

using Pixel = std::array<int, 3>;
constexpr Pixel kBlue{53, 167, 255}, kGreen{109, 255, 138}, kRed{255, 77, 58};

Pixel ColourAt(const Image& image, const Eigen::Vector2d& px) {
  const uint8_t* p = image.Pixel(static_cast<int>(std::lround(px.x())), static_cast<int>(std::lround(px.y())));
  return {p[0], p[1], p[2]};
}

/// Whether a pixel within one of this place has the colour: a line of two pixels covers the nearest ones whole.
bool HasNear(const Image& image, const Eigen::Vector2d& px, const Pixel& colour) {
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (ColourAt(image, px + Eigen::Vector2d(dx, dy)) == colour) return true;
    }
  }
  return false;
}

constexpr double kFocal = 500, kCx = 319.5, kCy = 239.5, kK1 = -0.2, kK2 = 0.05;

/// Brown's radial distortion by hand.
Eigen::Vector2d SeenAt(const Eigen::Vector3d& x_in_cam) {
  const double x = x_in_cam.x() / x_in_cam.z(), y = x_in_cam.y() / x_in_cam.z(), r2 = x * x + y * y;
  const double grown = 1 + kK1 * r2 + kK2 * r2 * r2;
  return {kFocal * x * grown + kCx, kFocal * y * grown + kCy};
}

class DrawnViewTest : public ::testing::Test {
 protected:
  void SetUp() override {
    geometry::RigCamera camera;
    camera.camera.name = "a";
    camera.camera.model = geometry::LensModel::kBrown2;
    camera.camera.width_px = 640, camera.camera.height_px = 480;
    camera.camera.params.resize(geometry::NumParams(camera.camera));
    camera.camera.params.setZero();
    camera.camera.params.head<6>() << kFocal, kFocal, kCx, kCy, kK1, kK2;
    scene_.rig.cameras.push_back(camera);
    scene_.cameras.push_back({"a", 0, "", ""});
    scene_.skeleton.joints = scene_.detected_skeleton.joints = {"Nose", "Neck"};
    scene_.skeleton.bones = {{0, 1}};
    dataset::JointsPose pose{Eigen::Matrix3Xd(3, 2), {true, true}, {1, 1}};
    pose.x_in_world << -1.1, 0.9, -0.6, 0.5, 2.1, 2.4;
    scene_.joints[7][0] = pose;
  }
  Eigen::Vector2d Joint(int j) const { return SeenAt(scene_.joints.at(7).at(0).x_in_world.col(j)); }

  Scene scene_;
};

TEST_F(DrawnViewTest, JointsAndBonesLieWhereTheLensPutsThem) {
  const Image drawn = DrawnView(scene_, 0, ViewAt(scene_, 0, 7), {}, {}, 0, {});
  ASSERT_EQ(drawn.width, 640);
  for (int j = 0; j < 2; ++j) EXPECT_EQ(ColourAt(drawn, Joint(j)), kBlue) << j;
  EXPECT_TRUE(HasNear(drawn, 0.5 * (Joint(0) + Joint(1)), kBlue)) << "the bone";
  const Eigen::Vector2d without(kFocal * -1.1 / 2.1 + kCx, kFocal * -0.6 / 2.1 + kCy);
  ASSERT_GT((without - Joint(0)).norm(), 10);
  EXPECT_EQ(ColourAt(drawn, without), (Pixel{0, 0, 0})) << "where it would be without distortion";
  EXPECT_EQ(DrawnView(scene_, 0, ViewAt(scene_, 0, 8), {}, {}, 0, {}).pixels, Image(640, 480, 3).pixels) << "nobody there";
}

TEST_F(DrawnViewTest, ReducedImagesKeepThePlaces) {
  const Image drawn = DrawnView(scene_, 0, ViewAt(scene_, 0, 7), Image(640, 480, 3, 40), {}, 320, {});
  ASSERT_EQ(drawn.width, 320);
  for (int j = 0; j < 2; ++j)
    EXPECT_EQ(ColourAt(drawn, (Joint(j).array() + 0.5).matrix() / 2 - Eigen::Vector2d(0.5, 0.5)), kBlue) << j;
}

TEST_F(DrawnViewTest, ResidualsGoFromTheProjectionToTheDetection) {
  dataset::Pose2dTrack track;
  track.camera = "a";
  dataset::Person2d person;
  std::vector<Eigen::Vector2d> seen;  // whole pixels, so that the ring's are known exactly
  for (int j = 0; j < 2; ++j) {
    seen.push_back((Joint(j) + Eigen::Vector2d(30, 12)).array().round());
    person.keypoints.push_back({seen.back().x(), seen.back().y(), 0.9});
  }
  track.frames[7] = {person};
  scene_.detections["a"] = track;
  const SceneView view = ViewAt(scene_, 0, 7);
  ASSERT_EQ(view.residuals.size(), 2u);
  EXPECT_NEAR(MedianResidualPx(view), 0.5 * ((seen[0] - Joint(0)).norm() + (seen[1] - Joint(1)).norm()), 1e-9);
  const Image drawn = DrawnView(scene_, 0, view, {}, {}, 0, {});
  EXPECT_TRUE(HasNear(drawn, 0.5 * (Joint(0) + seen[0]), kRed));
  EXPECT_EQ(ColourAt(drawn, seen[1] + Eigen::Vector2d(0, 4)), kGreen) << "the ring of what was found";
  OverlayMarks none;
  none.joints2d = none.joints3d = none.residuals = false;
  EXPECT_EQ(DrawnView(scene_, 0, view, {}, {}, 0, none).pixels, Image(640, 480, 3).pixels);
}

TEST_F(DrawnViewTest, SomebodyFarAwayIsSomebodyElse) {
  dataset::Pose2dTrack track;
  dataset::Person2d person;
  for (int j = 0; j < 2; ++j) person.keypoints.push_back({Joint(j).x() + 200, Joint(j).y(), 0.9});
  track.frames[7] = {person};
  scene_.detections["a"] = track;
  EXPECT_TRUE(ViewAt(scene_, 0, 7).residuals.empty());
}

TEST(GridOf, PutsImagesInRows) {
  const Image grid = GridOf({Image(5, 3, 3, 10), Image(5, 3, 3, 20), Image(4, 2, 3, 30)});
  ASSERT_EQ(grid.width, 12);
  ASSERT_EQ(grid.height, 8);
  EXPECT_EQ(*grid.Pixel(0, 0), 10);
  EXPECT_EQ(*grid.Pixel(6, 0), 20);
  EXPECT_EQ(*grid.Pixel(0, 4), 30);
  EXPECT_EQ(*grid.Pixel(11, 7), 0);
}

}  // namespace
}  // namespace mvstudio::stages
