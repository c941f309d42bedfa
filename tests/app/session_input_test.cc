#include "app/input/session_input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::app {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::Put;
using mvstudio::testing::TempDir;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr char kHead[] = "schema = \"mvstudio.session/1\"\nunits = \"mm\"\ncameras = [\"a\", \"b\"]\n";

std::string BoardTake(const std::string& name) {
  return "[[takes]]\nname = \"" + name + "\"\nkind = \"board\"\nfootage = \"raw/{camera}.mp4\"\n";
}

SessionArguments ArgumentsOf(const TempDir& folder, const std::string& toml, const std::string& take = "") {
  Put(folder / "mvstudio.toml", toml);
  for (const char* file : {"raw/a.mp4", "raw/b.mp4"}) Put(folder / file, "x");
  SessionArguments arguments;
  arguments.session = folder.path(), arguments.take = take;
  return arguments;
}

TEST(SessionInput, WithoutASessionThereIsNoTake) {
  CommandResult result;
  EXPECT_FALSE(FindTake({}, &result));
  SessionArguments take;
  take.take = "walk";
  CornerArguments corners;
  EXPECT_THAT(MessageOf<UsageError>([&] { FindTake(take, &result); }), HasSubstr("option 'take' needs option 'session'"));
  EXPECT_THAT(MessageOf<UsageError>([&] { FillCorners(take, &corners, &result); }), HasSubstr("option 'take'"));
}

TEST(SessionInput, PosesAreThoseOfTheTakesCameras) {
  const TempDir folder;
  const SessionArguments arguments =
      ArgumentsOf(folder, std::string(kHead) + "[[takes]]\nname = \"walk\"\nfootage = \"raw/{camera}.mp4\"\n");
  CommandResult result;
  const FoundTake found = FindTake(arguments, &result).value();
  EXPECT_EQ(found.take.name, "walk");
  PoseArguments pose;
  const auto fill = [&] { FillPoses(found, arguments, &pose); };
  EXPECT_THAT(MessageOf<UsageError>(fill), HasSubstr("option 'calib'"));
  Put(folder / "calib/calibration.json", "{}");
  EXPECT_THAT(MessageOf<UsageError>(fill), HasSubstr(folder / "pose2d/walk"));
  Put(folder / "pose2d/walk/b/0.json", "{}");
  fill();
  EXPECT_EQ(pose.calib, folder / "calib/calibration.json");
  EXPECT_THAT(pose.pose2d, ElementsAre("b=" + (folder / "pose2d/walk/b")));
  PoseArguments given;
  given.calib = "mine.json", given.points2d = "points.csv";
  FillPoses(found, arguments, &given);
  EXPECT_EQ(given.calib, "mine.json");
  EXPECT_TRUE(given.pose2d.empty());
}

TEST(SessionInput, BoardsAndTheirFootage) {
  const TempDir folder;
  const std::string board = "board = \"chessboard:9x6:25\"\n";
  CommandResult result;
  CornerArguments corners;
  FillCorners(ArgumentsOf(folder, kHead + board + BoardTake("board")), &corners, &result);
  EXPECT_THAT(corners.boards, ElementsAre("chessboard:9x6:25mm"));
  EXPECT_THAT(corners.cameras, ElementsAre("a=" + (folder / "raw/a.mp4"), "b=" + (folder / "raw/b.mp4")));
  CornerArguments given;
  given.boards = {"chessboard:3x4:1cm"}, given.corners = "corners.csv";
  FillCorners(ArgumentsOf(folder, kHead), &given, &result);
  EXPECT_THAT(given.boards, ElementsAre("chessboard:3x4:1cm"));
  EXPECT_TRUE(given.cameras.empty());
}

TEST(SessionInput, BoardsThatAreNotToBeFoundAreRefused) {
  const TempDir folder;
  const std::string board = "board = \"chessboard:9x6:25\"\n", two = BoardTake("board") + BoardTake("later");
  CommandResult result;
  const auto refused = [&](const std::string& toml, const std::string& take) {
    CornerArguments corners;
    const SessionArguments arguments = ArgumentsOf(folder, toml, take);
    return MessageOf<UsageError>([&] { FillCorners(arguments, &corners, &result); });
  };
  EXPECT_THAT(refused(kHead + two, ""), HasSubstr("option 'board'"));
  EXPECT_THAT(refused(kHead + board + two, ""), HasSubstr("several takes with a board"));
  EXPECT_THAT(refused(kHead + board, ""), HasSubstr("no take of kind \"board\""));
  EXPECT_THAT(refused(kHead + board + two, "last"), HasSubstr("option 'take' last"));
  CornerArguments corners;
  EXPECT_NO_THROW(FillCorners(ArgumentsOf(folder, kHead + board + two, "later"), &corners, &result));
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

TEST(SessionInput, PicturesKeepTheirNumbers) {
  const TempDir folder;
  dataset::WriteImage(Image(8, 8, 1), folder / "raw/c/0007.png");
  const SessionArguments arguments =
      ArgumentsOf(folder, std::string(kHead) + "[[takes]]\nname = \"walk\"\n[takes.footage]\na = \"raw/c\"\n");
  CommandResult result;
  const FoundTake found = FindTake(arguments, &result).value();
  PoseInput input;
  input.tracks = {Track("a", {7})};
  EXPECT_FALSE(RenumberByClock(found, arguments, &input));
  EXPECT_THAT(Numbers(input.tracks[0]), ElementsAre(std::pair(7, 7)));
}

}  // namespace
}  // namespace mvstudio::app
