#include "app/input/corner_input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/input/board_footage.h"
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

/// Blank pictures 0003.png and 0010.png; the word for the option.
std::string PutFootage(const TempDir& folder, const std::string& camera) {
  for (const char* name : {"/0003.png", "/0010.png"}) dataset::WriteImage(Image(64, 48, 3, 200), folder / camera + name);
  return camera + "=" + (folder / camera);
}

TEST(BoardFootage, PicturesAreNumberedByTheirNames) {
  const TempDir folder;
  CommandResult result;
  const std::vector<calib::Footage> footage = OpenFootage({PutFootage(folder, "b"), PutFootage(folder, "a")}, &result);
  ASSERT_EQ(footage.size(), 2u);
  EXPECT_EQ(footage[0].camera, "b");
  EXPECT_EQ(footage[1].path, folder / "a");
  EXPECT_EQ(footage[0].num_frames, 2);
  EXPECT_THAT(result.inputs, ElementsAre(folder / "b", folder / "a"));
  std::vector<int64_t> numbers;
  while (const auto frame = footage[0].next()) {
    numbers.push_back(frame->frame_idx);
    EXPECT_EQ(frame->image.width, 64);
    EXPECT_EQ(frame->image.height, 48);
  }
  EXPECT_THAT(numbers, ElementsAre(3, 10));
}

TEST(BoardFootage, WhatIsMissingOrGivenTwiceIsNamed) {
  const TempDir folder;
  const std::string a = PutFootage(folder, "a");
  CommandResult result;
  EXPECT_THAT(MessageOf<UsageError>([&] { OpenFootage({}, &result); }), HasSubstr("option 'camera'"));
  EXPECT_THAT(MessageOf<UsageError>([&] { OpenFootage({a, a}, &result); }), HasSubstr("option 'camera' a is given twice"));
  EXPECT_THAT(MessageOf<UsageError>([&] { OpenFootage({"a"}, &result); }), HasSubstr("option 'camera' a"));
  EXPECT_THAT(MessageOf<IoError>([&] { OpenFootage({"b=" + (folder / "none")}, &result); }), HasSubstr(folder / "none"));
}

/// Of an affine view of the board.
calib::CornerFile Corners() {
  calib::CornerFile file;
  file.cameras = {{"left", 640, 480}, {"right", 800, 600}};
  file.boards = {calib::ParseBoard("chessboard:4x3:25mm")};
  for (int view = 0; view < 4; ++view) {
    calib::Detection detection;
    detection.camera_idx = view % 2, detection.frame_idx = 10 + view / 2;
    detection.points_px.resize(2, 12);
    for (int corner = 0; corner < 12; ++corner) {
      detection.corner_ids.push_back(corner);
      detection.points_px.col(corner) << 100 + 20.25 * (corner % 4) + view, 80 + 21 * (corner / 4);
    }
    file.detections.push_back(detection);
  }
  return file;
}

TEST(CornerInputs, AFileOfCornersIsReadAsItWasWritten) {
  const TempDir folder;
  const calib::CornerFile file = Corners();
  calib::WriteCornerFile(file, folder / "corners.csv");
  CornerArguments arguments;
  arguments.corners = folder / "corners.csv";
  CommandResult result;
  const CornerInput read = ReadCornerInput(arguments, {}, &result);
  EXPECT_TRUE(read.found.empty());
  EXPECT_THAT(result.inputs, ElementsAre(folder / "corners.csv"));
  ASSERT_EQ(read.input.cameras.size(), 2u);
  EXPECT_EQ(read.input.cameras[1].name, "right");
  EXPECT_EQ(read.input.cameras[1].width_px, 800);
  ASSERT_EQ(read.input.boards.size(), 1u);
  EXPECT_EQ(calib::ToString(read.input.boards[0]), calib::ToString(file.boards[0]));
  ASSERT_EQ(read.input.detections.size(), 4u);
  for (const calib::Detection& detection : read.input.detections) {
    const calib::Detection& own = file.detections[2 * (detection.frame_idx - 10) + detection.camera_idx];
    EXPECT_EQ(detection.points_px, own.points_px);
    EXPECT_EQ(detection.corner_ids, own.corner_ids);
  }
}

TEST(CornerInputs, ContradictionsAreRefusedByName) {
  const TempDir folder;
  calib::WriteCornerFile(Corners(), folder / "corners.csv");
  const auto refused = [&](const std::vector<std::string>& boards, const std::vector<std::string>& cameras, bool file) {
    CornerArguments arguments;
    arguments.boards = boards, arguments.cameras = cameras;
    if (file) arguments.corners = folder / "corners.csv";
    CommandResult result;
    return MessageOf<UsageError>([&] { ReadCornerInput(arguments, {}, &result); });
  };
  const std::string board = "chessboard:4x3:25mm";
  EXPECT_THAT(refused({}, {"a=a.mp4"}, false), HasSubstr("option 'board' is needed"));
  EXPECT_THAT(refused({board}, {}, false), HasSubstr("option 'camera'"));
  EXPECT_THAT(refused({}, {"a=a.mp4"}, true), HasSubstr("not both"));
  EXPECT_THAT(refused({board, board}, {}, true), HasSubstr("option 'corners' takes one option 'board'"));
  EXPECT_THAT(refused({"chessboard:4x3"}, {"a=a.mp4"}, false), HasSubstr("chessboard:4x3"));
}

TEST(CornerInputs, ABoardThatLooksTheSameAfterHalfATurnIsToldOf) {
  const TempDir folder;
  const auto warnings = [&](const std::string& board) {
    CornerArguments arguments;
    arguments.boards = {board}, arguments.cameras = {PutFootage(folder, "a"), PutFootage(folder, "b")};
    arguments.footage.cache = "off";
    CommandResult result;
    EXPECT_THROW(ReadCornerInput(arguments, {}, &result), FormatError) << "blank pictures show no board";
    std::vector<std::string> codes;
    for (const Notice& notice : result.warnings) codes.push_back(notice.code);
    return codes;
  };
  EXPECT_THAT(warnings("chessboard:5x3:25mm"), ElementsAre("CAL-AMBIGUOUS"));
  EXPECT_THAT(warnings("chessboard:4x3:25mm"), ElementsAre());
}

}  // namespace
}  // namespace mvstudio::app
