#include "stages/input/take_input.h"

#include "core/error.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

std::string Refused(const TakeArguments& arguments) {
  InputNotes result;
  return MessageOf<UsageError>([&] { ReadTakeInput(arguments, &result); });
}

/// A session with the take "walk" of two cameras, and "empty" of none. Its footage is not opened.
void PutSession(const TempDir& folder) {
  Put(folder / "mvstudio.toml", R"(schema = "mvstudio.session/1"
units = "m"
fps_hz = 25
colour = "red"
cameras = ["left", "right"]
[[takes]]
name = "walk"
fps_hz = 50
[takes.footage]
left = "raw/walk/left.mp4"
right = "raw/walk/right.mp4"
[takes.plate]
left = "raw/plate/left.png"
[[takes]]
name = "empty"
kind = "plate"
)");
  for (const char* file : {"raw/walk/left.mp4", "raw/walk/right.mp4", "raw/plate/left.png"}) Put(folder / file, "x");
}

TEST(TakeInput, FootageAndPlatesByCamera) {
  TakeArguments arguments;
  arguments.video = {{"a", "a.mp4"}}, arguments.images = {{"b", "pictures/*.png"}}, arguments.plate = {{"b", "plate.png"}};
  InputNotes result;
  const TakeInput input = ReadTakeInput(arguments, &result);
  ASSERT_EQ(input.footage.size(), 2u);
  EXPECT_EQ(input.footage[0].path, "a.mp4");
  EXPECT_EQ(input.footage[0].plate, "");
  EXPECT_EQ(input.footage[1].camera, "b");
  EXPECT_EQ(input.footage[1].plate, "plate.png");
  EXPECT_THAT(result.inputs, ElementsAre("a.mp4", "pictures/*.png", "plate.png"));
  EXPECT_EQ(input.Folder("pose2d", "a"), "");
  EXPECT_FALSE(input.session);
}

TEST(TakeInput, ContradictionsAreRefusedByName) {
  TakeArguments twice;
  twice.video = {{"a", "a.mp4"}}, twice.images = {{"a", "pictures"}};
  EXPECT_THAT(Refused(twice), HasSubstr("option 'images' a=pictures: camera a was given footage twice"));
  TakeArguments plate;
  plate.video = {{"a", "a.mp4"}}, plate.plate = {{"b", "b.png"}};
  EXPECT_THAT(Refused(plate), HasSubstr("option 'plate' b=b.png: camera b has no footage"));
  TakeArguments take;
  take.take = "walk";
  EXPECT_THAT(Refused(take), HasSubstr("option 'take' needs option 'session'"));
  TakeArguments both;
  both.session = "somewhere", both.video = {{"a", "a.mp4"}};
  EXPECT_THAT(Refused(both), HasSubstr("either option 'session'"));
  TakeArguments name;
  name.video = {{"a/b", "a.mp4"}};
  EXPECT_THAT(Refused(name), HasSubstr("option 'video' a/b=a.mp4"));
}

TEST(TakeInput, OneRecordingIsNotOfTwoCameras) {
  const TempDir folder;
  const std::string video(4096, 'v');
  Put(folder / "a.mp4", video), Put(folder / "b.mp4", video), Put(folder / "c.mp4", std::string(4096, 'w'));
  TakeArguments arguments;
  arguments.video = {{"left", folder / "a.mp4"}, {"right", folder / "c.mp4"}, {"top", folder / "b.mp4"}};
  InputNotes result;
  const std::string same = MessageOf<FormatError>([&] { ReadTakeInput(arguments, &result); });
  EXPECT_THAT(same, HasSubstr("b.mp4: is the same recording as " + (folder / "a.mp4") + ": cameras left and top"));
  arguments.video.pop_back();
  EXPECT_EQ(ReadTakeInput(arguments, &result).footage.size(), 2u) << "of one size, but not the same";
  Put(folder / "images/0.png", "x");
  arguments.images = {{"top", folder / "images"}, {"side", (folder / "images") + "/*.png"}};
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadTakeInput(arguments, &result); }), HasSubstr("cameras top and side"));
}

TEST(TakeInput, ASessionsOnlyTakeWithPeople) {
  const TempDir folder;
  PutSession(folder);
  TakeArguments arguments;
  arguments.session = folder.path();
  InputNotes result;
  const TakeInput input = ReadTakeInput(arguments, &result);
  EXPECT_EQ(input.take, "walk");
  EXPECT_EQ(input.fps_hz, 50) << "the take's, not the session's";
  ASSERT_EQ(input.footage.size(), 2u);
  EXPECT_EQ(input.footage[0].path, folder / "raw/walk/left.mp4");
  EXPECT_EQ(input.footage[0].plate, folder / "raw/plate/left.png");
  EXPECT_EQ(input.footage[1].plate, "");
  EXPECT_EQ(input.footage[0].timeline, nullptr) << "nothing relates the cameras' clocks";
  EXPECT_EQ(input.calibration, "");
  EXPECT_EQ(input.Folder("pose2d", "left"), folder / "pose2d/walk/left");
  EXPECT_THAT(result.inputs, ElementsAre(folder / "raw/walk/left.mp4", folder / "raw/walk/right.mp4"));
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].code, "SES-KEY");
  EXPECT_THAT(result.warnings[0].text, HasSubstr("colour"));
  arguments.take = "empty";
  EXPECT_THAT(Refused(arguments), HasSubstr("take empty"));
  arguments.take = "run";
  EXPECT_THAT(Refused(arguments), HasSubstr("option 'take' run"));
}

}  // namespace
}  // namespace mvstudio::stages
