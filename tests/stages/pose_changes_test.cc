#include "stages/input/pose_changes.h"

#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

namespace mvstudio::stages {
namespace {

constexpr int kWidth = 1920, kHeight = 1080;

geometry::Rig Rig() {
  geometry::Rig rig;
  for (const char* name : {"a", "b"})
    rig.cameras.push_back(
        triangulate::LookAt(name, {static_cast<double>(rig.cameras.size()), 3, 0.5}, {0, 0, 0}, 1500, kWidth, kHeight));
  return rig;
}

/// One joint that moves, and one that was not seen.
std::vector<dataset::Pose2dTrack> Tracks() {
  std::vector<dataset::Pose2dTrack> tracks = {{"a", {}}, {"b", {}}};
  for (int f = 0; f < 40; ++f) {
    tracks[0].frames[f] = {{{{100.0 + 3 * f, 200.0 + f, 0.9}, {0, 0, 0}}}};
    tracks[1].frames[f] = {{{{700.0 - 2 * f, 300.0 + f, 0.9}, {0, 0, 0}}}};
  }
  return tracks;
}

/// What becomes of the pixel (x, y) of camera a.
std::pair<double, double> Changed(const PoseChanges& changes, double x, double y) {
  std::vector<dataset::Pose2dTrack> tracks = Tracks();
  tracks[0].frames = {{0, {{{{x, y, 1}, {0, 0, 0}}}}}};
  ApplyChanges(changes, Rig(), geometry::PointsSkeleton({"p", "q"}), &tracks);
  const dataset::Keypoint2d& key = tracks[0].frames.at(0)[0].keypoints[0];
  return {key.x_px, key.y_px};
}

PoseChanges Rotated(const std::string& text) {
  PoseChanges changes;
  FromString(text, "rotate", &changes.rotate.emplace_back());
  return changes;
}

/// Each change undoes what was done to the images of a pixel at (30, 50).
TEST(PoseChanges, PixelsBecomeThoseOfTheCalibratedImage) {
  const std::pair<double, double> pixel{30, 50};
  PoseChanges normalized, below, mirrored, half;
  normalized.normalized.all = below.flip_y.all = mirrored.flip_x.all = true;
  half.image_size = {{"a", "960x540"}};
  EXPECT_EQ(Changed({}, 30, 50), pixel);
  EXPECT_EQ(Changed(normalized, 30.0 / kWidth, 50.0 / kHeight), pixel);
  EXPECT_EQ(Changed(below, 30, kHeight - 50), pixel);
  EXPECT_EQ(Changed(mirrored, kWidth - 1 - 30, 50), pixel);
  EXPECT_EQ(Changed(Rotated("90"), kHeight - 1 - 50, 30), pixel);
  EXPECT_EQ(Changed(Rotated("a=180"), kWidth - 1 - 30, kHeight - 1 - 50), pixel);
  EXPECT_EQ(Changed(Rotated("270"), 50, kWidth - 1 - 30), pixel);
  EXPECT_EQ(Changed(Rotated("b=90"), 30, 50), pixel) << "another camera's";
  EXPECT_EQ(Changed(half, 30.5 / 2 - 0.5, 50.5 / 2 - 0.5), pixel);
}

/// 0.25 of the width, half of the height: in -1 to 1 and in percent.
TEST(PoseChanges, SharesOfOtherRanges) {
  PoseChanges normalized;
  normalized.normalized.names = {"a"};
  const std::pair<double, double> ranges[] = {{-1, 1}, {0, 100}};
  for (const auto& [low, high] : ranges) {
    const auto in_range = [low = low, high = high](double share) { return low + share * (high - low); };
    std::vector<dataset::Pose2dTrack> tracks = Tracks();
    tracks[0].frames = {{0, {{{{in_range(0.25), in_range(0.5), 1}, {in_range(0.1), in_range(1), 1}}}}}};
    ApplyChanges(normalized, Rig(), geometry::PointsSkeleton({"p", "q"}), &tracks);
    EXPECT_DOUBLE_EQ(tracks[0].frames.at(0)[0].keypoints[0].x_px, 480) << low;
    EXPECT_DOUBLE_EQ(tracks[0].frames.at(0)[0].keypoints[0].y_px, 540) << low;
  }
}

/// A quarter of 1920 and half of 1080, of a file that states shares.
TEST(PoseChanges, TracksOfSharesBecomePixelsOnce) {
  std::vector<dataset::Pose2dTrack> tracks = Tracks();
  tracks[0].frames = {{0, {{{{0.25, 0.5, 1}, {0, 0, 0}}}}}};
  tracks[0].normalized = true;
  for (int times = 0; times < 2; ++times) ApplyChanges({}, Rig(), geometry::PointsSkeleton({"p", "q"}), &tracks);
  EXPECT_EQ(tracks[0].frames.at(0)[0].keypoints[0].x_px, 480);
  EXPECT_EQ(tracks[0].frames.at(0)[0].keypoints[0].y_px, 540);
  EXPECT_EQ(tracks[1].frames.at(0)[0].keypoints[0].x_px, 700);
}

TEST(PoseChanges, RatesPutFramesAtCommonTimeSteps) {
  PoseChanges changes;
  changes.rate = {{"", "30"}, {"a", "60"}};
  std::vector<dataset::Pose2dTrack> tracks = Tracks();
  ApplyChanges(changes, Rig(), geometry::PointsSkeleton({"p", "q"}), &tracks);
  EXPECT_EQ(tracks[0].frames.size(), 20u);
  EXPECT_EQ(tracks[0].frames.at(7)[0].keypoints[0].x_px, 100.0 + 3 * 14);
  tracks = Tracks();
  changes.rate = {{"", "60"}, {"a", "30"}};
  ApplyChanges(changes, Rig(), geometry::PointsSkeleton({"p", "q"}), &tracks);
  EXPECT_EQ(tracks[0].frames.size(), 79u) << "between two frames, none after the last";
  EXPECT_NEAR(tracks[0].frames.at(15)[0].keypoints[0].x_px, 100 + 3 * 7.5, 1e-9);
}

TEST(PoseChanges, CamerasAreExchangedAndLeftOut) {
  PoseChanges changes;
  changes.swap_cameras = {"a,b"};
  std::vector<dataset::Pose2dTrack> tracks = Tracks();
  ApplyChanges(changes, Rig(), geometry::PointsSkeleton({"p", "q"}), &tracks);
  EXPECT_EQ(tracks[0].camera, "b");
  changes = {};
  changes.without_cameras = {"a"};
  ApplyChanges(changes, Rig(), geometry::PointsSkeleton({"p", "q"}), &tracks);
  ASSERT_EQ(tracks.size(), 1u);
  EXPECT_EQ(tracks[0].camera, "b");
}

TEST(PoseChanges, WhatMakesNoSenseIsRefused) {
  const auto message = [](const PoseChanges& changes) {
    std::vector<dataset::Pose2dTrack> tracks = Tracks();
    return MessageOf<UsageError>([&] { ApplyChanges(changes, Rig(), geometry::PointsSkeleton({"p", "q"}), &tracks); });
  };
  PoseChanges unknown, one_rate, no_rate;
  unknown.flip_y.names = {"c"};
  one_rate.rate = {{"a", "60"}}, no_rate.rate = {{"", "-1"}};
  EXPECT_THAT(message(unknown), HasSubstr("camera c, which has no 2D joints; there are a, b"));
  EXPECT_THAT(message(Rotated("45")), HasSubstr("90, 180 or 270"));
  EXPECT_THAT(message(Rotated("a=90degrees")), HasSubstr("is not a number"));
  EXPECT_THAT(message(one_rate), HasSubstr("says nothing of camera b"));
  EXPECT_THAT(message(no_rate), HasSubstr("above 0"));
}

TEST(RefuseEqual, OneRecordingForTwoCamerasWhateverTheirLenses) {
  geometry::Rig rig = Rig();
  std::vector<dataset::Pose2dTrack> tracks = Tracks();
  EXPECT_NO_THROW(RefuseEqual(tracks, rig, {}, "table.csv"));
  tracks[1].frames = tracks[0].frames;
  EXPECT_THAT(MessageOf<FormatError>([&] {
                RefuseEqual(tracks, rig, {{"a", "x"}, {"b", "y"}}, "");
              }),
              ::testing::AllOf(HasSubstr("y: cameras a and b"), HasSubstr("40 of 40 joints"), HasSubstr("'without-camera' b")));
  rig.cameras[1].cam_from_world = rig.cameras[0].cam_from_world;  // one camera under two names
  EXPECT_NO_THROW(RefuseEqual(tracks, rig, {}, "table.csv"));
}

}  // namespace
}  // namespace mvstudio::stages
