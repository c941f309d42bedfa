#include "calib/board/board.h"

#include "calib/board/charuco_layout.h"
#include "calib/board/print.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

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
  for (const char* text : {"chessboard:9x6:25mm",
                           "charuco:7x5:140mm:105mm:4x4_1000",
                           "charuco:8x6:60mm:45mm:apriltag_36h11:legacy",
                           "charuco:5x4:54mm:40.5mm:4x4_1000:inverted",
                           "charuco:8x6:60mm:45mm:4x4_50:legacy:inverted",
                           "aprilgrid:6x6:88mm:0.3:36h11",
                           "aprilgrid:4x3:20mm:0.25:25h9:first=5",
                           "aprilgrid:4x3:20mm:0.25:36h11:first=5:border=1",
                           "aprilgrid:2x2:20mm:0.8:Standard41h12",
                           "tag:36h11:7:100mm",
                           "tag:16h5:3:55mm:border=2",
                           "tag:Circle49h12:60000:55mm",
                           "grid:10x10:77mm",
                           "chessboard:8x6:25mm:inverted",
                           "chessboard:9x6:22.5x24.5mm",
                           "grid:4x7:200x150mm",
                           "circles:7x6:30mm",
                           "circles:7x6:30x32mm:20mm",
                           "acircles:4x11:20mm",
                           "acircles:4x11:20mm:12mm:inverted"}) {
    EXPECT_EQ(ToString(ParseBoard(text)), text);
  }
}

TEST(ParseBoard, RefusesWithTheExpectedForm) {
  for (const char* text : {"",
                           "dots:3x3:1m",
                           "chessboard:9x6",
                           "chessboard:9x6:25",
                           "chessboard:9:25mm",
                           "chessboard:9x6:-1mm",
                           "chessboard:9x6:nanmm",
                           "charuco:8x6:60mm",
                           "charuco:8x6:60mm:60mm",
                           "charuco:8x6:60mm:45mm:9x9_9",
                           "charuco:20x20:60mm:45mm:4x4_50",
                           "chessboard:1x6:25mm",
                           "chessboard:9x6:1e999mm",
                           "aprilgrid:6x6:88mm",
                           "aprilgrid:6x6:88mm:0",
                           "aprilgrid:6x6:88mm:nan",
                           "aprilgrid:6x6:88mm:0.3:99h9",
                           "aprilgrid:6x6:88mm:0.3:16h5",
                           "aprilgrid:2x2:88mm:0.3:Standard41h12",
                           "aprilgrid:6x6:88mm:0.3:first=x",
                           "aprilgrid:6x6:88mm:0.3:border=3",
                           "tag:36h11:587:1m",
                           "tag:36h11:-1:1m",
                           "tag:36h11:7",
                           "tag:36h11:7:1m:x",
                           "tag:Standard41h12:7:1m:border=2",
                           "grid:10x10",
                           "grid:1x10:77mm",
                           "chessboard:9x6:25mm:white",
                           "chessboard:9x6:25x",
                           "chessboard:9x6:2x25mm",
                           "chessboard:9x6:0x19mm",
                           "charuco:8x6:0x3Cmm:45mm",
                           "circles:7x6:30mm:30mm",
                           "circles:2x2:30mm",
                           "acircles:4x11:20x30mm",
                           "points:",
                           "chessboard:99999999999x6:25mm"}) {
    try {
      ParseBoard(text);
      FAIL() << text;
    } catch (const UsageError& e) {
      const bool known = std::string(text).size() > 0 && std::string(text).substr(0, 4) != "dots";
      const std::string kind = known ? std::string(text).substr(0, std::string(text).find(':')) : "chessboard";
      EXPECT_NE(std::string(e.what()).find("expected " + kind + ":"), std::string::npos) << e.what();
    }
  }
}

TEST(ParseBoard, CellsThatAreNotSquare) {
  for (const char* text : {"grid:4x7:200x150mm", "grid:4x7:20x15cm", "grid:4x7:0.2mx15cm"}) {
    const Eigen::Matrix3Xd corners = CornersInBoard(ParseBoard(text));
    EXPECT_TRUE(corners.col(27).isApprox(Eigen::Vector3d(0.6, 0.9, 0), 1e-12)) << text << corners.col(27);
  }
  EXPECT_EQ(ToString(ParseBoard("chessboard:9x6:25x25mm")), "chessboard:9x6:25mm");
}

/// OpenCV's asymmetric grid: ((2 j + i % 2) s, i s) for row i.
TEST(ParseBoard, AsymmetricCirclesLieAsInOpenCv) {
  const Eigen::Matrix3Xd centres = CornersInBoard(ParseBoard("acircles:4x11:20mm"));
  ASSERT_EQ(centres.cols(), 44);
  EXPECT_TRUE(centres.col(1).isApprox(Eigen::Vector3d(0.04, 0, 0)));
  EXPECT_TRUE(centres.col(4).isApprox(Eigen::Vector3d(0.02, 0.02, 0)));
  EXPECT_TRUE(centres.col(43).isApprox(Eigen::Vector3d(0.12, 0.2, 0)));
}

TEST(ParseBoard, PointsComeFromAFile) {
  const mvstudio::testing::TempDir folder;
  const auto points = [&](const std::string& table, const std::string& unit = "") {
    WriteFileAtomic(folder / "target.csv", table);
    return ParseBoard("points:" + (folder / "target.csv") + unit);
  };
  const Board board = points("# a box\nid,x,y,z\n3,1,2,3\n0,0,0,0\n1,1,0,0\n2,0,1,0.5\n");
  EXPECT_EQ(board.kind, Board::Kind::kPoints);
  ASSERT_EQ(board.num_corners(), 4);
  EXPECT_EQ(board.points.col(3), Eigen::Vector3d(1, 2, 3)) << "metres";
  EXPECT_EQ(board.points.col(2), Eigen::Vector3d(0, 1, 0.5));
  const std::string four = "0,0,0\n1000,0,0\n0,1000,0\n0,0,1000\n";
  EXPECT_EQ(points("x_mm,y_mm,z_mm\n" + four).points.col(1), Eigen::Vector3d(1, 0, 0)) << "rows in order, the header's unit";
  EXPECT_EQ(points("x,y,z\n" + four, ":cm").points.col(1), Eigen::Vector3d(10, 0, 0));
  for (const char* bad : {"", "id,x,y\n0,0,0\n", "id,x,y,z\n0,0,0,0\n1,1,0,0\n", "x,y,z_mm\n0,0,0\n",
                          "id,x,y,z\n0,0,0,0\n0,1,0,0\n1,1,1,0\n2,1,1,1\n", "id,x,y,z\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,1,1,1\n",
                          "id,x,y,z\n0,0,0,a\n1,1,0,0\n2,1,1,0\n3,1,1,1\n"})
    EXPECT_THROW(points(bad), FormatError) << bad;
  EXPECT_THROW(ParseBoard("points:" + (folder / "none.csv")), IoError);
}

/// Kalibr's lengths are metres; its checkerboards count inner corners, its rows lie rowSpacingMeters apart.
TEST(ParseBoard, TargetsOfKalibr) {
  const mvstudio::testing::TempDir folder;
  const auto read = [&](const std::string& text, const char* name = "target.yaml") {
    WriteFileAtomic(folder / name, text);
    return ToString(ParseBoard(folder / name));
  };
  const std::string tags =
      "target_type: 'aprilgrid' #gridtype\ntagCols: 6   # tags: per row\ntagRows: 5\ntagSize: 0.088\ntagSpacing: 0.3\n";
  EXPECT_EQ(read(tags), "aprilgrid:6x5:88mm:0.3:36h11");
  EXPECT_EQ(read("{\"target_type\": \"aprilgrid\", \"tagCols\": 6, \"tagRows\": 5,\n \"tagSize\": 0.088, \"tagSpacing\": 0.3}",
                 "board.json"),
            "aprilgrid:6x5:88mm:0.3:36h11");
  const std::string chess =
      "target_type: 'checkerboard'\ntargetCols: 6\ntargetRows: 7\ncolSpacingMeters: 0.05\nrowSpacingMeters: ";
  EXPECT_EQ(read(chess + "0.05\n"), "chessboard:6x7:50mm");
  const Board oblong = ParseBoard((read(chess + "0.06\n"), folder / "target.yaml"));
  EXPECT_EQ(CornersInBoard(oblong).col(7), Eigen::Vector3d(0.05, 0.06, 0));
  const std::string circles = "target_type: circlegrid\ntargetCols: 4\ntargetRows: 11\nspacingMeters: 0.02\nasymmetricGrid: ";
  EXPECT_EQ(read(circles + "False\n"), "circles:4x11:20mm");
  EXPECT_EQ(read(circles + "True\n"), "acircles:4x11:20mm");
  const std::pair<std::string, const char*> wrong[] = {{tags + "tagFamily: 25h9\n", "tagFamily"},
                                                       {"target_type: aprilgrid\ntagCols: 6\n", "tagRows"},
                                                       {chess + "50\n", "metres"},
                                                       {"target_type: star\n", "'star'"},
                                                       {circles + "maybe\n", "asymmetricGrid"},
                                                       {tags + "tagRows: 6\n", "twice"},
                                                       {"cam0:\n  camera_model: pinhole\n", "target_type"}};
  for (const auto& [text, words] : wrong)
    EXPECT_NE(mvstudio::testing::MessageOf<FormatError>([&] { read(text); }).find(words), std::string::npos) << words;
  EXPECT_THROW(ParseBoard(folder / "none.yaml"), IoError);
}

TEST(ParseBoard, BoardsOfMultical) {
  const mvstudio::testing::TempDir folder;
  const auto read = [&](const std::string& text) {
    WriteFileAtomic(folder / "boards.yaml", text);
    return ToString(ParseBoard(folder / "boards.yaml"));
  };
  const std::string charuco =
      "    _type_: 'charuco'\n    size: [16, 22]\n    aruco_dict: '5X5_1000'\n    square_length: 0.025\n    marker_length: "
      "0.01875\n";
  EXPECT_EQ(read("boards:\n  a:\n" + charuco + "    min_rows: 3\n"), "charuco:16x22:25mm:18.75mm:5x5_1000");
  EXPECT_EQ(read("boards:\n  a:\n    _type_: aprilgrid\n    size: [6, 5]\n    tag_family: t36h11\n    tag_length: 0.088\n"
                 "    tag_spacing: 0.3\n    start_id: 40\n"),
            "aprilgrid:6x5:88mm:0.3:36h11:first=40");
  const std::string two = "common:\n" + charuco + "boards:\n  a:\n    size: [16, 22]\n  b:\n    aruco_offset: 176\n";
  const std::string why = mvstudio::testing::MessageOf<UsageError>([&] { read(two); });
  EXPECT_NE(why.find("holds 2 boards of multical"), std::string::npos) << why;
  EXPECT_NE(why.find("option 'board' charuco:16x22:0.025m:0.01875m:5x5_1000:first=176"), std::string::npos) << why;
}

std::string Refusal(const std::string& text) {
  try {
    ParseBoard(text);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ParseBoard, TakesOtherSpellings) {
  const std::pair<const char*, const char*> same[] = {
      {"checkerboard:9x6:25mm", "chessboard:9x6:25mm"},
      {"ChessBoard:9X6:25MM", "chessboard:9x6:25mm"},
      {"ChArUco:8x6:60mm:45mm:DICT_4X4_1000", "charuco:8x6:60mm:45mm:4x4_1000"},
      {"charuco_board:8x6:60mm:45mm:apriltag_36H11", "charuco:8x6:60mm:45mm:apriltag_36h11"},
      {"april_grid:6x6:88mm:0.3:tag36h11", "aprilgrid:6x6:88mm:0.3:36h11"},
      {"tag:tagStandard41h12:7:1m", "tag:Standard41h12:7:1m"}};
  for (const auto& [other, ours] : same) EXPECT_EQ(ToString(ParseBoard(other)), ToString(ParseBoard(ours))) << other;
}

TEST(ParseBoard, FootageInItsPlaceIsNamed) {
  const mvstudio::testing::TempDir folder;
  WriteFileAtomic(folder / "left01.jpg", "");
  for (const std::string& text : {folder / "left01.jpg", folder / ""}) {
    const std::string refused = mvstudio::testing::MessageOf<UsageError>([&] { ParseBoard(text); });
    EXPECT_NE(refused.find("is a file or folder"), std::string::npos) << refused;
    EXPECT_NE(refused.find("option 'camera' NAME=PATH"), std::string::npos) << refused;
  }
}

TEST(ParseBoard, SaysTheReasonFirstAndTheFormOfThisKind) {
  const std::string refusal = Refusal("chessboard:9x6:25");
  EXPECT_NE(refusal.find("has no unit: write 25mm"), std::string::npos) << refusal;
  EXPECT_EQ(refusal.find("charuco"), std::string::npos) << refusal;
  EXPECT_NE(Refusal("chesboard:9x6:25mm").find("did you mean 'chessboard'?"), std::string::npos);
  EXPECT_NE(Refusal("charuco:8x6:60mm:45mm:DICT_9X9_1").find("known are 4x4_50"), std::string::npos);
}

TEST(CornersInBoard, RowByRow) {
  const Eigen::Matrix3Xd corners = CornersInBoard(ParseBoard("chessboard:4x3:10mm"));
  ASSERT_EQ(corners.cols(), 12);
  EXPECT_EQ(corners.col(0), Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(corners.col(5), Eigen::Vector3d(0.01, 0.01, 0));
  EXPECT_EQ(corners.col(11), Eigen::Vector3d(0.03, 0.02, 0));
}

TEST(CornersInBoard, AprilGridInKalibrsOrder) {
  const Board board = ParseBoard("aprilgrid:3x2:100mm:0.25");
  const Eigen::Matrix3Xd corners = CornersInBoard(board);
  ASSERT_EQ(corners.cols(), 24);
  EXPECT_EQ(corners.col(0), Eigen::Vector3d(0, 0, 0)) << "bottom left of tag 0";
  EXPECT_EQ(corners.col(1), Eigen::Vector3d(0.1, 0, 0));
  EXPECT_EQ(corners.col(2), Eigen::Vector3d(0.1, -0.1, 0)) << "y points down: up is negative";
  EXPECT_EQ(corners.col(3), Eigen::Vector3d(0, -0.1, 0));
  EXPECT_TRUE(corners.col(4).isApprox(Eigen::Vector3d(0.125, 0, 0))) << "tag 1 stands to the right";
  EXPECT_TRUE(corners.col(4 * 3).isApprox(Eigen::Vector3d(0, -0.125, 0))) << "tag 3 stands above tag 0";
  EXPECT_EQ(CornersInBoard(ParseBoard("tag:36h11:7:100mm")).rightCols<1>(), Eigen::Vector3d(0, -0.1, 0));
}

TEST(CornersInBoard, PointsAreTheirOwn) {
  Board board;
  board.kind = Board::Kind::kPoints;
  board.points = Eigen::Matrix3Xd::Random(3, 5);
  EXPECT_EQ(CornersInBoard(board), board.points);
  EXPECT_EQ(board.num_corners(), 5);
  EXPECT_EQ(ToString(board), "points:5");
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

TEST(DrawBoard, InvertedExchangesBlackAndWhiteOfTheBoardAlone) {
  const Image plain = DrawBoard(ParseBoard("charuco:5x4:40mm:30mm"), 32, 1),
              inverted = DrawBoard(ParseBoard("charuco:5x4:40mm:30mm:inverted"), 32, 1);
  for (int v = 0; v < plain.height; ++v) {
    for (int u = 0; u < plain.width; ++u) {
      const bool margin = u < 32 || v < 32 || u >= plain.width - 32 || v >= plain.height - 32;
      ASSERT_EQ(*inverted.Pixel(u, v), margin ? 255 : 255 - *plain.Pixel(u, v)) << u << " " << v;
    }
  }
}

TEST(DrawBoard, EveryRectangleIsInkOnce) {
  for (const char* text : {"chessboard:5x4:10mm", "charuco:5x4:40mm:30mm:inverted", "aprilgrid:2x3:50mm:0.3",
                           "tag:Circle21h7:3:1m", "aprilgrid:2x2:50mm:0.8:Standard41h12"}) {
    const Board board = ParseBoard(text);
    const BoardPrint print = PrintOf(board);
    double area = 0;
    for (const PrintRect& r : print.black) {
      area += (r.high - r.low).prod();
      EXPECT_TRUE((r.low.array() >= print.low_m.array() - 1e-12).all() &&
                  (r.high.array() <= print.high_m.array() + 1e-12).all())
          << text;
    }
    const Image image = DrawBoard(board, 90, 0);
    double ink = 0;
    for (uint8_t grey : image.pixels) ink += (255 - grey) / 255.0;
    EXPECT_NEAR(ink / image.pixels.size(), area / (print.high_m - print.low_m).prod(), 2e-3) << text << ": overlap or gap";
  }
}

/// Kalibr's own generator writes tag 0 of 36h11 as the code 0xd5d628584 with the first bit at the top left, white for 1, inside
/// a black border of 2 cells (kalibr_create_target_pdf).
TEST(DrawBoard, FirstTagOfAnAprilGridIsKalibrs) {
  const Board board = ParseBoard("aprilgrid:2x2:100mm:0.3");
  const Image image = DrawBoard(board, 100, 0);  // 10 px a cell
  const int left = 30, top = image.height - 30 - 100;
  for (int row = 0; row < 10; ++row) {
    for (int col = 0; col < 10; ++col) {
      const bool inside = row >= 2 && row < 8 && col >= 2 && col < 8;
      const bool white = inside && (0xd5d628584ull >> (35 - (6 * (row - 2) + col - 2)) & 1);
      EXPECT_EQ(*image.Pixel(left + 10 * col + 5, top + 10 * row + 5), white ? 255 : 0) << row << " " << col;
    }
  }
  EXPECT_EQ(*image.Pixel(15, image.height - 15), 0) << "black squares at the crossings of the gaps, also outside";
  EXPECT_EQ(*image.Pixel(80, image.height - 15), 255);
}

TEST(DrawBoard, RefusesWhatHasNoPrint) { EXPECT_THROW(DrawBoard(ParseBoard("grid:10x10:77mm"), 8, 1), UsageError); }

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
