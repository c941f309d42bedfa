#include "app/input/session_input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/message_of.h"

namespace mvstudio::app {
namespace {

using mvstudio::testing::MessageOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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

TEST(SessionInput, FramesGetTheInstantsThatTheyShow) {
  dataset::Timeline timeline;
  dataset::CameraTimeline a, b;
  a.name = "a", a.frame_at = {0, 2, -1, 3};  // frame 1 shows no instant, instant 2 has no frame
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

}  // namespace
}  // namespace mvstudio::app
