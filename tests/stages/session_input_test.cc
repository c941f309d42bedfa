#include "stages/input/session_input.h"

#include <filesystem>

#include "core/error.h"
#include "geometry/lens/camera.h"
#include "geometry/rig/rig_io.h"
#include "stages/result.h"
#include "tests/dataset/clip_writer.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

TEST(SessionInput, WithoutASessionThereIsNoTake) {
  CommandResult result;
  EXPECT_FALSE(FindTake({}, &result));
  SessionArguments take;
  take.take = "walk";
  CornerArguments corners;
  EXPECT_THAT(MessageOf<UsageError>([&] { FindTake(take, &result); }), HasSubstr("option 'take' needs option 'session'"));
  EXPECT_THAT(MessageOf<UsageError>([&] { FillCorners(take, &corners, &result); }), HasSubstr("option 'take'"));
}

/// A track whose frame n holds one joint at x = n.
dataset::Pose2dTrack Track(const std::string& camera, const std::vector<int>& frames) {
  dataset::Pose2dTrack track{camera, {}};
  for (const int n : frames) {
    dataset::Person2d person;
    person.keypoints.push_back({static_cast<double>(n), 0, 1});
    track.frames[n].push_back(person);
  }
  return track;
}

/// Number of each frame -> where its joint says it came from.
std::vector<std::pair<int, int>> Numbers(const dataset::Pose2dTrack& track) {
  std::vector<std::pair<int, int>> numbers;
  for (const auto& [n, people] : track.frames) numbers.emplace_back(n, static_cast<int>(people[0].keypoints[0].x_px));
  return numbers;
}

TEST(SessionInput, FramesGetTheTimeStepsThatTheyShow) {
  dataset::Timeline timeline;
  dataset::CameraTimeline a, b;
  a.name = "a", a.frame_at = {0, 2, -1, 3};  // frame 1 shows no time step, time step 2 has no frame
  b.name = "b", b.frame_at = {5, 5, 6};      // frame 5 shows two
  timeline.cameras = {a, b};
  PoseInput input;
  input.tracks = {Track("a", {0, 1, 2, 3}), Track("b", {5, 6}), Track("c", {4})};
  EXPECT_TRUE(RenumberByTimeline(timeline, &input));
  EXPECT_THAT(Numbers(input.tracks[0]), ElementsAre(std::pair(0, 0), std::pair(1, 2), std::pair(3, 3)));
  EXPECT_THAT(Numbers(input.tracks[1]), ElementsAre(std::pair(0, 5), std::pair(1, 5), std::pair(2, 6)));
  EXPECT_THAT(Numbers(input.tracks[2]), ElementsAre(std::pair(4, 4))) << "a camera that the timeline does not have";
}

TEST(SessionInput, ATimelineThatMovesNothingChangesNothing) {
  dataset::Timeline timeline;
  dataset::CameraTimeline a;
  a.name = "a", a.frame_at = {0, 1, 2, 3};
  timeline.cameras = {a};
  PoseInput input;
  input.tracks = {Track("a", {0, 1, 3})};
  EXPECT_FALSE(RenumberByTimeline(timeline, &input));
  EXPECT_THAT(Numbers(input.tracks[0]), ElementsAre(std::pair(0, 0), std::pair(1, 1), std::pair(3, 3)));
}

/// A session with one take of people, filmed by cameras a (a video), b and c (images).
FoundTake PeopleTake(const TempDir& folder) {
  FoundTake found;
  found.session.folder = folder.path(), found.session.units = "m";
  found.take.name = "walk";
  for (const char* name : {"a", "b", "c"}) {
    found.session.cameras.push_back({name, "", "", 0, 0});
    const std::string path = std::string("raw/") + name + (name[0] == 'a' ? ".mkv" : "");
    found.take.footage.push_back({name, path, ""});
    if (name[0] != 'a') Put(folder / (path + "/0001.png"), "");
  }
  found.session.takes = {found.take};
  return found;
}

TEST(SessionInput, PosesAndCalibrationAreWhereTheSessionKeepsThem) {
  const TempDir folder;
  const FoundTake found = PeopleTake(folder);
  PoseArguments pose;
  EXPECT_THAT(MessageOf<UsageError>([&] { FillPoses(found, {}, &pose); }),
              HasSubstr("run mvstudio calibrate option 'session' " + folder.path()));
  Put(folder / "calib/calibration.json", "{}");
  EXPECT_THAT(MessageOf<UsageError>([&] { FillPoses(found, {}, &pose); }), HasSubstr("pose2d/walk: no 2D poses"));
  for (const char* name : {"a", "c"}) std::filesystem::create_directories(folder / ("pose2d/walk/" + std::string(name)));
  pose = {};
  FillPoses(found, {}, &pose);
  EXPECT_EQ(pose.calib, folder / "calib/calibration.json");
  ASSERT_EQ(pose.pose2d.size(), 2u) << "b has no poses";
  EXPECT_EQ(pose.pose2d[0].name, "a");
  EXPECT_EQ(pose.pose2d[1].path, folder / "pose2d/walk/c");
}

TEST(SessionInput, ACameraWithoutCalibrationIsNamedAndLeftOut) {
  const TempDir folder;
  geometry::Rig rig;
  for (const char* name : {"a", "b"}) {
    geometry::RigCamera camera;
    camera.camera = geometry::MakePinhole(name, 80, 60, 70);
    rig.cameras.push_back(camera);
  }
  geometry::WriteRig(rig, folder / "calibration.json");
  PoseArguments pose;
  pose.calib = folder / "calibration.json";
  pose.pose2d = {{"a", "x"}, {"b", "y"}, {"lost", "z"}};
  CommandResult result;
  LeaveOutUncalibrated(&pose, &result);
  ASSERT_EQ(pose.pose2d.size(), 2u);
  EXPECT_TRUE(result.partial);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].code, "CAL-LEFTOUT");
  EXPECT_THAT(result.warnings[0].text, HasSubstr("lost"));
  LeaveOutUncalibrated(&pose, &result);
  EXPECT_EQ(result.warnings.size(), 1u) << "nothing more to leave out";
  pose.pose2d = {{"a", "x"}, {"lost", "z"}};
  EXPECT_THAT(MessageOf<FormatError>([&] { LeaveOutUncalibrated(&pose, &result); }), HasSubstr("fewer than two"));
}

TEST(SessionInput, WhatIsGivenIsNotReplacedByTheSessions) {
  const TempDir folder;
  const FoundTake found = PeopleTake(folder);
  std::filesystem::create_directories(folder / "pose2d/walk/a");
  PoseArguments pose, points;
  pose.calib = points.calib = "own.json";
  pose.pose2d = {{"b", "elsewhere"}}, points.points2d = "points.csv";
  FillPoses(found, {}, &pose), FillPoses(found, {}, &points);
  EXPECT_EQ(pose.calib, "own.json");
  ASSERT_EQ(pose.pose2d.size(), 1u);
  EXPECT_EQ(pose.pose2d[0].path, "elsewhere");
  EXPECT_TRUE(points.pose2d.empty());
}

/// The third and the fourth image of the video were dropped: its frame 2 was filmed at tick 4.
TEST(SessionInput, FramesOfAVideoThatDroppedSomeGetTheirTicks) {
  const TempDir folder;
  const FoundTake found = PeopleTake(folder);
  std::vector<int64_t> pts;
  std::vector<int> codes;
  for (int n = 0; n < 20; ++n) {
    if (n == 2 || n == 3) continue;
    pts.push_back(3003 * n), codes.push_back(n);
  }
  mvstudio::testing::WriteClip(folder / "raw/a.mkv", pts, {}, codes);
  PoseInput input;
  input.tracks = {Track("a", {0, 1, 2, 7}), Track("b", {0, 2}), Track("other", {2})};
  EXPECT_TRUE(RenumberByClock(found, {}, &input));
  EXPECT_THAT(Numbers(input.tracks[0]), ElementsAre(std::pair(0, 0), std::pair(1, 1), std::pair(4, 2), std::pair(9, 7)));
  EXPECT_THAT(Numbers(input.tracks[1]), ElementsAre(std::pair(0, 0), std::pair(2, 2))) << "pictures are numbered by ticks";
  EXPECT_THAT(Numbers(input.tracks[2]), ElementsAre(std::pair(2, 2))) << "a camera that the take does not have";
  input.tracks = {Track("b", {0, 2})};
  EXPECT_FALSE(RenumberByClock(found, {}, &input));
}

}  // namespace
}  // namespace mvstudio::stages
