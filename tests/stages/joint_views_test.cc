#include "stages/triangulate/joint_views.h"

#include "core/statistics.h"
#include "dataset/footage/image_io.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

namespace mvstudio::stages {
namespace {

constexpr int kNumJoints = 3;

/// One joint seen by `cameras`, each keypoint `error_px` to the right of the projection.
void AddPoint(const geometry::Rig& rig, int frame, int person, int joint, double error_px, const std::vector<int>& cameras,
              triangulate::TakeResult* take) {
  triangulate::TakePoint entry;
  entry.frame = frame, entry.person = person, entry.joint_idx = joint;
  entry.point.status = Status::kOk, entry.point.rms_px = error_px;
  entry.point.x_in_world = {0.1 * joint, 0.3 * person, 0.1};
  std::vector<triangulate::Observation> seen;
  for (triangulate::Observation observation : triangulate::Observe(rig, entry.point.x_in_world)) {
    if (std::find(cameras.begin(), cameras.end(), observation.camera_idx) == cameras.end()) continue;
    observation.px.x() += error_px;
    seen.push_back(observation);
  }
  take->points.push_back(entry);
  take->observations.push_back(seen);
}

TEST(JointViews, OneTimeStepForAllCamerasThatSeeSomebody) {
  const geometry::Rig rig = triangulate::MakeRing(3);
  triangulate::TakeResult take;
  for (const auto& [frame, error] : {std::pair(4, 0.5), std::pair(5, 2.0), std::pair(6, 9.0)}) {
    for (int joint = 0; joint < kNumJoints; ++joint) AddPoint(rig, frame, 0, joint, error, {0, 1}, &take);
  }
  AddPoint(rig, 9, 0, 1, 1.0, {1, 2}, &take);
  const auto views = ChooseJointViews(rig, take, kNumJoints, {});
  ASSERT_EQ(views.size(), 3u);
  EXPECT_EQ(views[0].time_step, 5) << "the median of the rich ones";
  EXPECT_EQ(views[1].time_step, 5);
  EXPECT_EQ(views[2].time_step, 9) << "the third camera sees nobody in step 5";
  EXPECT_EQ(views[0].frame, -1) << "no footage";
  ASSERT_EQ(views[0].keypoint_px.size(), size_t{kNumJoints});
  for (int joint = 0; joint < kNumJoints; ++joint) {
    EXPECT_NEAR((views[0].keypoint_px[joint] - views[0].projected_px[joint]).x(), 2, 1e-9);
    EXPECT_NEAR((views[0].keypoint_px[joint] - views[0].projected_px[joint]).y(), 0, 1e-9);
  }
}

TEST(JointViews, NothingWithoutPoints) {
  const geometry::Rig rig = triangulate::MakeRing(2);
  triangulate::TakeResult take;
  EXPECT_TRUE(ChooseJointViews(rig, take, kNumJoints, {}).empty());
  AddPoint(rig, 1, 0, 0, 1, {0, 1}, &take);
  take.points[0].point.status = Status::kLowParallax;
  EXPECT_TRUE(ChooseJointViews(rig, take, kNumJoints, {}).empty());
}

TEST(JointViews, TheTimelineSaysWhichImageShowsATimeStep) {
  const geometry::Rig rig = triangulate::MakeRing(2);
  triangulate::TakeResult take;
  AddPoint(rig, 1, 0, 0, 1, {0, 1}, &take);
  auto timeline = std::make_shared<dataset::Timeline>();
  timeline->cameras.resize(1);
  timeline->cameras[0].name = "cam_0";
  timeline->cameras[0].frame_at = {7, 8};
  const auto views = ChooseJointViews(rig, take, kNumJoints, {{{"cam_0", "/gone"}, {"cam_1", "/gone"}}, timeline});
  EXPECT_EQ(views[0].frame, 8);
  EXPECT_EQ(views[1].frame, -1) << "it is not in the timeline";
}

TEST(JointViews, DistancesAndAnImageAroundThePerson) {
  const geometry::Rig rig = triangulate::MakeRing(2);
  triangulate::TakeResult take;
  AddPoint(rig, 0, 0, 0, 1.0, {0, 1}, &take);
  AddPoint(rig, 0, 1, 2, 3.0, {0, 1}, &take);
  TempDir folder;
  dataset::WriteImage(Image(1280, 960, 1, 200), folder / "a/0.png");
  dataset::WriteImage(Image(640, 480, 1, 200), folder / "b/0.png");
  geometry::Skeleton skeleton{"three", {"A", "B", "C"}, {{0, 1}, {1, 2}}};
  const CommandResult result = DescribeJointViews(
      WriteJointViews(rig, take, skeleton, {{{"cam_0", folder / "a"}, {"cam_1", folder / "b"}}, nullptr}, folder / "out"));
  const auto& views = result.metrics["overlays"]["views"];
  ASSERT_EQ(views.size(), 2u);
  EXPECT_EQ(result.metrics["overlays"]["bones"].dump(), "[[0,1],[1,2]]");
  EXPECT_NEAR(views[0]["median_px"].get<double>(), 2, 1e-9);
  EXPECT_NEAR(views[0]["max_px"].get<double>(), 3, 1e-9);
  EXPECT_EQ(views[0]["num_points"], 2);
  ASSERT_EQ(views[0]["joints"].size(), 6u) << "two persons of three joints";
  EXPECT_EQ(views[0]["joints"][1].dump(), "[null,null,null,null]");
  const auto& box = views[0]["box_px"];
  for (const int at : {0, 5}) {
    const double x = views[0]["joints"][at][0], y = views[0]["joints"][at][1];
    EXPECT_TRUE(x > box[0] && x < box[0].get<double>() + box[2].get<double>());
    EXPECT_TRUE(y > box[1] && y < box[1].get<double>() + box[3].get<double>());
  }
  ASSERT_EQ(result.outputs.size(), 1u);
  const Image image = dataset::ReadImage(result.outputs[0].path);
  EXPECT_NEAR(image.width / double(image.height), box[2].get<double>() / box[3].get<double>(), 0.02);
  EXPECT_EQ(views[1]["picture"], nullptr) << "its images have another size than it was calibrated for";
}

}  // namespace
}  // namespace mvstudio::stages
