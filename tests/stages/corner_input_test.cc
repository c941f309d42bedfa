#include "stages/input/corner_input.h"

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/input/board_footage.h"
#include "stages/result.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

/// Blank images 0003.png and 0010.png; the word for the option.
NamedPath PutFootage(const TempDir& folder, const std::string& camera) {
  for (const char* name : {"/0003.png", "/0010.png"}) dataset::WriteImage(Image(64, 48, 3, 200), folder / camera + name);
  return {camera, folder / camera};
}

TEST(BoardFootage, ImagesAreNumberedByTheirNames) {
  const TempDir folder;
  CommandResult result;
  const std::vector<calib::Footage> footage = OpenFootage({PutFootage(folder, "b"), PutFootage(folder, "a")}, &result);
  ASSERT_EQ(footage.size(), 2u);
  EXPECT_EQ(footage[0].camera, "b");
  EXPECT_THAT(result.inputs, ElementsAre(folder / "b", folder / "a"));
  std::vector<int64_t> numbers;
  while (const auto frame = footage[0].next()) numbers.push_back(frame->frame_idx);
  EXPECT_THAT(numbers, ElementsAre(3, 10));
}

TEST(BoardFootage, WhatIsMissingOrGivenTwiceIsNamed) {
  const TempDir folder;
  const NamedPath a = PutFootage(folder, "a");
  CommandResult result;
  EXPECT_THAT(MessageOf<UsageError>([&] { OpenFootage({}, &result); }), HasSubstr("option 'camera'"));
  EXPECT_THAT(MessageOf<FormatError>([&] {
                OpenFootage({a, {"b", a.path}}, &result);
              }),
              HasSubstr("is the same recording as " + a.path + ": cameras a and b"));
  EXPECT_THAT(MessageOf<UsageError>([&] { OpenFootage({a, a}, &result); }), HasSubstr("option 'camera' a is given twice"));
  EXPECT_THAT(MessageOf<IoError>([&] { OpenFootage({{"b", folder / "none"}}, &result); }), HasSubstr(folder / "none"));
}

/// Four plane projective views of a grid of 5 columns and 3 rows, numbered row by row.
TEST(CornerInputs, ColumnsAndRowsThatAreExchangedAreNamedWithTheBoard) {
  const TempDir folder;
  std::string text = "camera,frame,corner,x_px,y_px\n";
  for (int frame = 0; frame < 4; ++frame) {
    for (int id = 0; id < 15; ++id) {
      const double col = id % 5, row = id / 5, depth = 1 + 0.02 * frame * col + 0.01 * row;
      text += "a," + std::to_string(frame) + "," + std::to_string(id) + "," + std::to_string((100 + 40 * col) / depth) + "," +
              std::to_string((80 + 40 * row) / depth) + "\n";
    }
  }
  WriteFileAtomic(folder / "corners.csv", text);
  CornerArguments arguments;
  arguments.corners = folder / "corners.csv";
  CommandResult result;
  arguments.boards = {calib::ParseBoard("chessboard:5x3:30mm")};
  EXPECT_EQ(ReadCornerInput(arguments, {}, &result).input.detections.size(), 4u);
  arguments.boards = {calib::ParseBoard("chessboard:3x5:30mm")};
  const std::string refused = MessageOf<FormatError>([&] { ReadCornerInput(arguments, {}, &result); });
  EXPECT_THAT(refused, HasSubstr("columns and rows are exchanged"));
  EXPECT_THAT(refused, HasSubstr("give option 'board' chessboard:5x3:"));
}

TEST(CornerInputs, ContradictionsAreRefusedByName) {
  const auto refused = [](const std::vector<calib::Board>& boards, const std::vector<NamedPath>& cameras,
                          const std::string& corners) {
    CornerArguments arguments;
    arguments.boards = boards, arguments.cameras = cameras, arguments.corners = corners;
    CommandResult result;
    return MessageOf<UsageError>([&] { ReadCornerInput(arguments, {}, &result); });
  };
  const calib::Board board = calib::ParseBoard("chessboard:4x3:25mm");
  EXPECT_THAT(refused({}, {{"a", "a.mp4"}}, ""), HasSubstr("option 'board' is needed"));
  EXPECT_THAT(refused({board}, {}, ""), HasSubstr("option 'camera'"));
  EXPECT_THAT(refused({}, {{"a", "a.mp4"}}, "corners.csv"), HasSubstr("not both"));
  EXPECT_THAT(refused({board, board}, {}, "corners.csv"), HasSubstr("option 'corners' takes one option 'board'"));
}

TEST(CornerInputs, OptionsWithoutEffectAreRefused) {
  CornerArguments arguments;
  arguments.corners = "corners.csv";
  arguments.footage.every = 5, arguments.footage.detect.max_misfit = 0.1;
  CommandResult result;
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadCornerInput(arguments, {}, &result); }),
              HasSubstr("option 'every', option 'max-misfit' has no effect here: nothing is searched"));
  CornerArguments footage;
  footage.boards = {calib::ParseBoard("chessboard:4x3:25mm")}, footage.cameras = {{"a", "a.mp4"}};
  footage.corner_files.sizes = {{"", 640, 480}};
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadCornerInput(footage, {}, &result); }),
              HasSubstr("option 'size' has no effect here"));
}

TEST(CornerInputs, ABoardThatLooksTheSameAfterHalfATurnIsToldOf) {
  const TempDir folder;
  const auto warnings = [&](const std::string& board) {
    CornerArguments arguments;
    arguments.boards = {calib::ParseBoard(board)}, arguments.cameras = {PutFootage(folder, "a"), PutFootage(folder, "b")};
    arguments.footage.cache.kind = CachePlace::Kind::kOff;
    CommandResult result;
    EXPECT_THROW(ReadCornerInput(arguments, {}, &result), FormatError) << "blank pictures show no board";
    std::vector<std::string> codes;
    for (const Notice& notice : result.warnings) codes.push_back(notice.code);
    return codes;
  };
  EXPECT_THAT(warnings("chessboard:5x3:25mm"), ElementsAre("CAL-AMBIGUOUS"));
  EXPECT_THAT(warnings("chessboard:4x3:25mm"), ElementsAre());
}

TEST(CornerInputs, ATableOfTimesPairsFootage) {
  const TempDir folder;
  CornerArguments arguments;
  arguments.cameras = {PutFootage(folder, "a"), PutFootage(folder, "b")};
  arguments.timestamps = folder / "times.csv";
  WriteFileAtomic(arguments.timestamps, "camera,frame,time_s\na,3,10.0\na,10,10.5\nb,3,10.5\nb,10,11.0\n");
  CommandResult result;
  FillTimeline(&arguments, &result);
  ASSERT_TRUE(arguments.timeline);
  const auto later = dataset::TimeStepOfEachFrame(*arguments.timeline->Find("a")).at(10);
  EXPECT_EQ(dataset::TimeStepOfEachFrame(*arguments.timeline->Find("b")).at(3), later) << "both at 10.5 s";
  EXPECT_THAT(result.inputs, ElementsAre(arguments.timestamps));
  arguments.cameras.clear();
  EXPECT_THAT(MessageOf<UsageError>([&] { FillTimeline(&arguments, &result); }), HasSubstr("option 'timestamps'"));
  arguments.timestamps.clear();
  FillTimeline(&arguments, &result);
}

}  // namespace
}  // namespace mvstudio::stages
