#include "stages/input/take_frames.h"

#include <cmath>

#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

namespace mvstudio::stages {
namespace {

dataset::Person2d Person(double x_px) {
  dataset::Person2d person;
  person.keypoints = {{x_px, 1.0 / 3, 0.25}, {0, 0, 0}};
  return person;
}

TEST(TakeFrames, EveryFrameOfAnyCameraInTheRigsOrder) {
  const geometry::Rig rig = triangulate::MakeRing(3);
  dataset::Pose2dTrack first{"cam_2", {}}, second{"cam_0", {}};
  first.frames[9] = {Person(7)};
  first.frames[4] = {};
  second.frames[9] = {Person(8), Person(9)};
  const auto frames = ToFrames({first, second}, rig, "calib.json");
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0].frame, 4);
  EXPECT_EQ(frames[1].frame, 9);
  for (const auto& frame : frames) EXPECT_EQ(frame.people.size(), 3u);
  EXPECT_TRUE(frames[0].people[2].empty());
  ASSERT_EQ(frames[1].people[0].size(), 2u);
  EXPECT_TRUE(frames[1].people[1].empty());
  ASSERT_EQ(frames[1].people[2].size(), 1u);
  EXPECT_EQ(frames[1].people[0][1][0].px, Eigen::Vector2d(9, 1.0 / 3));
  EXPECT_EQ(frames[1].people[2][0][0].score, 0.25);
  EXPECT_EQ(frames[1].people[2][0][1].score, 0);
  EXPECT_TRUE(ToFrames({}, rig, "calib.json").empty());
}

TEST(TakeFrames, ACameraThatIsNotCalibratedIsNamedWithBothLists) {
  const geometry::Rig rig = triangulate::MakeRing(2);
  const std::vector<dataset::Pose2dTrack> tracks = {{"cam_1", {}}, {"left", {}}};
  const std::string message = MessageOf<FormatError>([&] { ToFrames(tracks, rig, "calib.json"); });
  for (const char* text : {"calib.json: cameras", "camera left", "poses: cam_1, left", "calibrated: cam_0, cam_1"}) {
    EXPECT_THAT(message, HasSubstr(text));
  }
}

triangulate::TakePoint PointOf(int joint, Status status) {
  triangulate::TakePoint entry;
  entry.frame = 5, entry.person = 1, entry.joint_idx = joint;
  entry.point.status = status, entry.point.num_observations = 4;
  entry.point.x_in_world = {1.0 / 3, -2, 1e-9};
  entry.point.used = {0, 2, 3}, entry.point.rms_px = 0.625;
  return entry;
}

TEST(TakeFrames, RowsKeepPointsStatusAndUncertainty) {
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25");
  triangulate::TakeResult take;
  take.points = {PointOf(0, Status::kOk), PointOf(8, Status::kOk), PointOf(24, Status::kLowParallax)};
  take.points[0].point.covariance = Eigen::Vector3d(1e-6, 4e-6, 4e-6).asDiagonal();
  const dataset::Pose3d pose = ToPose3d(take, skeleton);
  EXPECT_EQ(pose.skeleton, "body25");
  ASSERT_EQ(pose.rows.size(), 3u);
  EXPECT_EQ(pose.rows[0].joint, "Nose");
  EXPECT_EQ(pose.rows[1].joint, "MidHip");
  EXPECT_NEAR(pose.rows[0].sigma_m, std::sqrt(3e-6), 1e-12);
  EXPECT_EQ(pose.rows[0].num_views, 3);
  EXPECT_EQ(pose.rows[0].rms_px, 0.625);
  EXPECT_TRUE(pose.rows[0].covariance.has_value());
  EXPECT_FALSE(pose.rows[1].covariance.has_value()) << "zero is unknown";
  EXPECT_EQ(pose.rows[2].status, Status::kLowParallax);
  EXPECT_EQ(pose.rows[2].num_views, 4) << "that were offered";
  EXPECT_TRUE(pose.rows[2].x_in_world.isZero(0)) << "no sentinel of a point that is none";
  const TempDir folder;
  dataset::WritePose3d(pose, folder.path());
  const dataset::Pose3d back = dataset::ReadPose3d(folder.path());
  ASSERT_EQ(back.rows.size(), 3u);
  EXPECT_EQ(back.rows[0].x_in_world, take.points[0].point.x_in_world);
  EXPECT_EQ(*back.rows[0].covariance, take.points[0].point.covariance);
  EXPECT_EQ(back.rows[2].status, Status::kLowParallax);
}

}  // namespace
}  // namespace mvstudio::stages
