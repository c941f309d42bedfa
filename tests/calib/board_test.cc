#include "calib/board.h"

#include <gtest/gtest.h>

#include "calib/charuco_layout.h"
#include "core/error.h"

namespace mvstudio::calib {
namespace {

TEST(ParseBoard, ReadsChessboardAndCharuco) {
  const Board chess = ParseBoard("chessboard:9x6:2.5cm");
  EXPECT_EQ(chess.kind, Board::Kind::kChessboard);
  EXPECT_EQ(chess.cols, 9);
  EXPECT_EQ(chess.rows, 6);
  EXPECT_DOUBLE_EQ(chess.square_m, 0.025);
  const Board charuco = ParseBoard("charuco:8x6:60mm:0.045m:6x6_250:legacy");
  EXPECT_EQ(charuco.cols, 7);
  EXPECT_EQ(charuco.rows, 5);
  EXPECT_DOUBLE_EQ(charuco.marker_m, 0.045);
  EXPECT_EQ(charuco.dictionary, "6x6_250");
  EXPECT_TRUE(charuco.legacy);
}

TEST(ParseBoard, TextRoundTrip) {
  for (const char* text :
       {"chessboard:9x6:25mm", "charuco:7x5:140mm:105mm:4x4_1000", "charuco:8x6:60mm:45mm:apriltag_36h11:legacy"}) {
    EXPECT_EQ(ToString(ParseBoard(text)), text);
  }
}

TEST(ParseBoard, RefusesWithTheExpectedForm) {
  for (const char* text : {"", "dots:3x3:1m", "chessboard:9x6", "chessboard:9x6:25", "chessboard:9:25mm", "chessboard:9x6:-1mm",
                           "chessboard:9x6:nanmm", "charuco:8x6:60mm", "charuco:8x6:60mm:60mm", "charuco:8x6:60mm:45mm:9x9_9",
                           "charuco:20x20:60mm:45mm:4x4_50", "chessboard:1x6:25mm", "chessboard:9x6:1e999mm"}) {
    try {
      ParseBoard(text);
      FAIL() << text;
    } catch (const UsageError& e) {
      EXPECT_NE(std::string(e.what()).find("expected chessboard:"), std::string::npos) << e.what();
    }
  }
}

TEST(CornersInBoard, RowByRow) {
  const Eigen::Matrix3Xd corners = CornersInBoard(ParseBoard("chessboard:4x3:10mm"));
  ASSERT_EQ(corners.cols(), 12);
  EXPECT_EQ(corners.col(0), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(corners.col(5), Eigen::Vector3d(0.01, 0.01, 0));
  EXPECT_EQ(corners.col(11), Eigen::Vector3d(0.03, 0.02, 0));
}

TEST(DrawBoard, ColoursChangeAtTheCorners) {
  const Board board = ParseBoard("chessboard:4x3:10mm");
  const Image image = DrawBoard(board, 20, 1);
  ASSERT_EQ(image.width, (5 + 2) * 20);
  ASSERT_EQ(image.height, (4 + 2) * 20);
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 4; ++col) {
      const int u = (col + 2) * 20, v = (row + 2) * 20;  // first pixel right of and below the corner
      EXPECT_NE(*image.Pixel(u, v), *image.Pixel(u - 1, v));
      EXPECT_NE(*image.Pixel(u, v), *image.Pixel(u, v - 1));
      EXPECT_EQ(*image.Pixel(u, v), *image.Pixel(u - 1, v - 1));
    }
  }
  EXPECT_EQ(*image.Pixel(25, 25), 0) << "the top left square is black";
  EXPECT_EQ(*image.Pixel(5, 5), 255) << "the margin is white";
}

TEST(DrawBoard, LegacyDiffersOnlyForEvenRowsOfSquares) {
  const auto draw = [](const std::string& text) { return DrawBoard(ParseBoard(text), 16, 0).pixels; };
  EXPECT_EQ(draw("charuco:7x5:40mm:30mm"), draw("charuco:7x5:40mm:30mm:legacy"));
  EXPECT_NE(draw("charuco:7x6:40mm:30mm"), draw("charuco:7x6:40mm:30mm:legacy"));
}

TEST(MarkerSquares, AreWhiteAndHalfOfAll) {
  for (const char* text : {"charuco:7x6:40mm:30mm", "charuco:7x6:40mm:30mm:legacy"}) {
    const Board board = ParseBoard(text);
    const auto squares = MarkerSquares(board);
    EXPECT_EQ(squares.size(), 21u);
    for (const Square& square : squares) EXPECT_FALSE(IsBlack(board, square));
  }
  EXPECT_TRUE(MarkerSquares(ParseBoard("chessboard:4x3:10mm")).empty());
}

}  // namespace
}  // namespace mvstudio::calib
