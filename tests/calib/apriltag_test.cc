#include "calib/board/apriltag.h"

#include <cmath>

#include "calib/board/board.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

TEST(TagFamilies, AllOfTheLibrary) {
  EXPECT_EQ(AllTagFamilies().size(), 9u);
  EXPECT_FALSE(FindTagFamily("36h12").has_value());
  const TagFamily classic = *FindTagFamily("36h11"), newer = *FindTagFamily("Standard41h12");
  EXPECT_EQ(classic.num_tags, 587);
  EXPECT_EQ(classic.border_cells, 8);
  EXPECT_EQ(classic.total_cells, 10);
  EXPECT_FALSE(classic.white_inside);
  EXPECT_EQ(newer.num_tags, 2115);
  EXPECT_EQ(newer.border_cells, 5);
  EXPECT_EQ(newer.total_cells, 9);
  EXPECT_TRUE(newer.white_inside);
}

TEST(PatternOf, BorderOfClassicTags) {
  for (const int border : {1, 2}) {
    const TagPattern pattern = PatternOf(*FindTagFamily("36h11"), 5, border);
    EXPECT_EQ(pattern.border_cells, 6 + 2 * border);
    const int n = pattern.total_cells;
    ASSERT_EQ(n, 8 + 2 * border);
    for (int i = 0; i < n; ++i) {
      EXPECT_EQ(pattern.black[i], 0) << "white around";
      const bool inside = i >= 1 && i < n - 1;
      for (int ring = 1; inside && ring <= border; ++ring) EXPECT_EQ(pattern.black[ring * n + i], 1) << ring << " " << i;
    }
  }
}

/// Both widths of border carry the same bits.
TEST(PatternOf, WideBorderKeepsTheCode) {
  const TagFamily family = *FindTagFamily("25h9");
  const TagPattern narrow = PatternOf(family, 3, 1), wide = PatternOf(family, 3, 2);
  for (int row = 2; row < 7; ++row) {
    for (int col = 2; col < 7; ++col) {
      EXPECT_EQ(narrow.black[row * narrow.total_cells + col], wide.black[(row + 1) * wide.total_cells + col + 1]);
    }
  }
}

/// A tag whose square spans the pixels [40, 120) has its corners at 39.5 and 119.5, and not at 40 and 120.
TEST(FindTags, PixelOriginIsTheCentreOfTheFirstPixel) {
  Board board;
  board.kind = Board::Kind::kTag;
  board.cols = board.rows = 1;
  board.square_m = 1;
  board.dictionary = "36h11";
  board.first_tag = 21;
  const Image image = DrawBoard(board, 80, 0.5);
  ASSERT_EQ(image.width, 160);
  const std::vector<Tag> tags = FindTags(*FindTagFamily("36h11"), TagBorder::kNarrow, image);
  ASSERT_EQ(tags.size(), 1u);
  EXPECT_EQ(tags[0].id, 21);
  EXPECT_EQ(tags[0].hamming, 0);
  Eigen::Matrix<double, 2, 4> expected;
  expected << 39.5, 119.5, 119.5, 39.5, 119.5, 119.5, 39.5, 39.5;
  EXPECT_LT((tags[0].px - expected).cwiseAbs().maxCoeff(), 0.25) << tags[0].px;
  EXPECT_LT(std::abs((tags[0].px - expected).mean()), 0.02) << "errors of a symmetric square cancel";
}

TEST(FindTags, NothingInTinyOrEmptyImages) {
  const TagFamily family = *FindTagFamily("36h11");
  for (const auto& [width, height] : {std::pair{1, 1}, {15, 400}, {16, 16}, {17, 33}, {640, 480}}) {
    EXPECT_TRUE(FindTags(family, TagBorder::kEither, Image(width, height, 1, 127)).empty());
  }
}

TEST(FindTags, EitherBorderIsToldWhenBothAreAllowed) {
  const TagFamily family = *FindTagFamily("36h11");
  for (const int border : {1, 2}) {
    for (const int id : {2, 4, 100}) {
      Board board;
      board.kind = Board::Kind::kTag;
      board.cols = board.rows = 1;
      board.square_m = 1;
      board.dictionary = "36h11";
      board.first_tag = id;
      board.tag_border = border;
      const auto tags = FindTags(family, TagBorder::kEither, DrawBoard(board, 80, 0.5));
      ASSERT_EQ(tags.size(), 1u) << id;
      EXPECT_EQ(tags[0].border, border) << id;
      EXPECT_EQ(tags[0].id, id);
    }
  }
}

}  // namespace
}  // namespace mvstudio::calib
