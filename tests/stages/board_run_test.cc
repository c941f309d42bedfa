#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/board/describe.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// Options in, report out, without the program.
namespace mvstudio::stages {
namespace {

/// The board that was drawn is the truth: searched for with rows and columns exchanged, it is still the one that is named.
TEST(BoardStage, TheBoardThatWasDrawnIsFound) {
  const TempDir folder;
  BoardDrawing drawing;
  drawing.board = "charuco:7x5:25mm:18mm:5x5_50", drawing.out = folder / "board.png", drawing.page.dpi = 100;
  const BoardDrawn drawn = RunBoardDraw(drawing);
  EXPECT_EQ(drawn.board.num_corners(), 24);
  EXPECT_EQ(Describe(drawn).outputs.at(0).path, drawing.out);
  BoardSearch search;
  search.images = {drawing.out}, search.board = "charuco:5x7:25mm:18mm:5x5_50";
  const BoardSearched searched = RunBoardSearch(search);
  ASSERT_TRUE(searched.check.best.has_value());
  EXPECT_EQ(calib::ToString(searched.check.trials[*searched.check.best].board), drawing.board);
  const CommandResult said = Describe(searched);
  EXPECT_THAT(said.errors, IsEmpty());
  EXPECT_THAT(said.inputs, ElementsAre(drawing.out));
  EXPECT_EQ(said.metrics["board"], drawing.board);
  EXPECT_THAT(said.text, HasSubstr("option 'board' " + drawing.board));
}

TEST(BoardStage, AWallShowsNoBoard) {
  const TempDir folder;
  dataset::WriteImage(Image(320, 240, 3, 170), folder / "wall.png");
  BoardSearch search;
  search.images = {folder / "wall.png"}, search.board = "chessboard:9x6:20mm";
  const CommandResult said = Describe(RunBoardSearch(search));
  EXPECT_EQ(said.exit, kExitBadInput);
  EXPECT_EQ(said.errors.at(0).code, "BRD-NONE");
  EXPECT_TRUE(said.metrics["board"].is_null());
  search.max_images = 0;
  EXPECT_THAT(MessageOf<UsageError>([&] { RunBoardSearch(search); }), HasSubstr("option 'max-images' must be 1 or more"));
  search.board = "grid:9x6:20mm";
  EXPECT_THAT(MessageOf<UsageError>([&] { RunBoardSearch(search); }), HasSubstr("is for corner files"));
}

TEST(BoardStage, ProposalsAreWrittenAsTheyAreTyped) {
  const BoardsProposed proposed = RunBoardProposals({});
  ASSERT_FALSE(proposed.boards.empty());
  const CommandResult said = Describe(proposed);
  ASSERT_EQ(said.metrics["boards"].size(), proposed.boards.size());
  EXPECT_EQ(said.metrics["boards"][0]["board"], calib::ToString(proposed.boards[0].board));
}

}  // namespace
}  // namespace mvstudio::stages
