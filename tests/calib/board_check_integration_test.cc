#include <algorithm>

#include "calib/board/guess.h"
#include "calib/detect/board_check.h"
#include "calib/detect/detect_board.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

std::vector<Image> Photos(const std::string& text, bool mirrored = false) {
  const Board board = ParseBoard(text);
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown4, 620);
  const BoardPrint print = PrintOf(board);
  const double size = (print.high_m - print.low_m).norm();
  const Eigen::Vector2d center = (print.low_m + print.high_m) / 2;
  std::vector<Image> images;
  for (const Eigen::Vector3d& rotation : {Eigen::Vector3d(0.3, -0.2, 0.1), Eigen::Vector3d(-0.2, 0.3, 1.7)}) {
    geometry::Rigid3 pose;
    pose.rotation = geometry::RotationExp(rotation);
    pose.translation = Eigen::Vector3d(0, 0, 1.5 * size) - pose.rotation * Eigen::Vector3d(center.x(), center.y(), 0);
    images.push_back(RenderBoard(board, camera, pose, 3));
    Image& image = images.back();
    for (int v = 0; mirrored && v < image.height; ++v) std::reverse(image.Pixel(0, v), image.Pixel(0, v) + image.width);
  }
  return images;
}

struct CheckOutcome {
  std::string text, relation;
  int num_images = 0;
  bool mirrored = false;
};

CheckOutcome Check(const std::string& printed, const std::string& claimed, bool mirrored = false) {
  std::optional<Board> given;
  if (!claimed.empty()) given = ParseBoard(claimed);
  const BoardCheckReport report = CheckBoard(given, Photos(printed, mirrored), RunContext());
  if (!report.best) return {};
  const BoardTrial& best = report.trials[*report.best];
  EXPECT_LT(best.residual_px, 0.3);
  return {BoardText(best.board, report.scale_known), best.relation, best.num_images, best.mirrored};
}

TEST(CheckBoard, ChessboardCounts) {
  for (const auto& [claimed, relation] : {std::pair{"chessboard:7x5:30mm", "as given"},
                                          {"chessboard:8x6:30mm", "the given numbers count squares, not inner corners"},
                                          {"chessboard:6x4:30mm", "the given numbers count inner corners, not squares"}}) {
    const CheckOutcome outcome = Check("chessboard:7x5:30mm", claimed);
    EXPECT_EQ(outcome.text, "chessboard:7x5:30mm");
    EXPECT_EQ(outcome.relation, relation) << claimed;
    EXPECT_EQ(outcome.num_images, 2);
  }
  EXPECT_EQ(Check("chessboard:7x5:30mm", "").text, "chessboard:7x5:SQUARE");
  EXPECT_EQ(Check("chessboard:7x5:30mm", "chessboard:11x4:30mm").text, "chessboard:7x5:30mm");
}

/// Parts of a board of many squares look like boards, and a search for one of those takes seconds an image.
TEST(CheckBoard, ManySquaresInManyImages) {
  const std::vector<Image> two = Photos("chessboard:24x17:10mm");
  std::vector<Image> images;
  for (int i = 0; i < 12; ++i) images.push_back(two[i % 2]);
  const BoardCheckReport report = CheckBoard(std::nullopt, images, RunContext());
  ASSERT_TRUE(report.best);
  EXPECT_EQ(BoardText(report.trials[*report.best].board, false), "chessboard:24x17:SQUARE");
  EXPECT_EQ(report.trials[*report.best].num_images, 12);
  EXPECT_EQ(report.trials.size(), 1u) << "the parts are not tried";
}

/// The board is in none of the images that are looked at first.
TEST(CheckBoard, ABoardInOneOfManyImages) {
  std::vector<Image> images(9, Image(640, 480, 1, 128));
  images[2] = Photos("chessboard:7x5:30mm")[0];
  const BoardCheckReport report = CheckBoard(ParseBoard("chessboard:7x5:30mm"), images, RunContext());
  ASSERT_TRUE(report.best);
  EXPECT_EQ(report.trials[*report.best].relation, "as given");
  EXPECT_EQ(report.trials[*report.best].num_images, 1);
}

/// The images that are looked at first (0, 2, 4, 7, 9) show another board than most.
TEST(CheckBoard, WhatAFewImagesShowIsNotAllThereIs) {
  const std::vector<Image> other = Photos("charuco:5x4:40mm:30mm:4x4_50"), most = Photos("charuco:7x5:40mm:30mm:6x6_250");
  std::vector<Image> images;
  for (const int i : {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}) {
    const bool first = i == 0 || i == 2 || i == 4 || i == 7 || i == 9;
    images.push_back((first ? other : most)[static_cast<size_t>(i) % 2]);
  }
  const BoardCheckReport report = CheckBoard(std::nullopt, images, RunContext());
  ASSERT_TRUE(report.best);
  EXPECT_EQ(report.trials[*report.best].board.dictionary, "6x6_1000");
  EXPECT_EQ(report.trials[*report.best].num_images, 7);
}

TEST(CheckBoard, CharucoMistakes) {
  const std::string printed = "charuco:7x6:40mm:30mm:5x5_250:legacy";
  const CheckOutcome exchanged = Check(printed, "charuco:6x7:40mm:30mm:5x5_250");
  EXPECT_EQ(exchanged.text, printed);
  EXPECT_EQ(exchanged.relation, "rows and columns exchanged, legacy layout");
  const CheckOutcome inner = Check(printed, "charuco:6x5:40mm:30mm:5x5_250:legacy");
  EXPECT_EQ(inner.text, printed) << inner.relation;
  const CheckOutcome dictionary = Check(printed, "charuco:7x6:40mm:30mm:4x4_50");
  EXPECT_EQ(dictionary.text, "charuco:7x6:40mm:30mm:5x5_1000:legacy");
  EXPECT_EQ(dictionary.relation, "another dictionary, legacy layout");
  EXPECT_EQ(Check(printed, "charuco:9x9:40mm:30mm:5x5_250").text, printed);
  const CheckOutcome mirrored = Check("charuco:7x5:40mm:30mm:6x6_250", "charuco:7x5:40mm:30mm:6x6_250", true);
  EXPECT_TRUE(mirrored.mirrored);
  EXPECT_EQ(mirrored.text, "charuco:7x5:40mm:30mm:6x6_250");
}

TEST(CheckBoard, InvertedCharucoWithoutAHint) {
  const CheckOutcome outcome = Check("charuco:5x7:40mm:30mm:4x4_50:inverted", "");
  EXPECT_EQ(outcome.text, "charuco:5x7:SQUARE:0.75*SQUARE:4x4_1000:inverted");
  EXPECT_EQ(Check("charuco:5x7:40mm:30mm:4x4_50:inverted", "charuco:5x7:40mm:30mm:4x4_50").relation,
            "black and white exchanged");
}

TEST(CheckBoard, AprilGrids) {
  const CheckOutcome exchanged = Check("aprilgrid:5x3:40mm:0.3:36h11", "aprilgrid:3x5:40mm:0.3:36h11");
  EXPECT_EQ(exchanged.text, "aprilgrid:5x3:40mm:0.3:36h11");
  EXPECT_EQ(exchanged.relation, "rows and columns exchanged");
  EXPECT_EQ(Check("aprilgrid:4x3:40mm:0.5:36h11:first=24", "aprilgrid:4x3:40mm:0.5:36h11:first=24").relation, "as given");
  EXPECT_EQ(Check("aprilgrid:4x3:40mm:0.5:36h11", "aprilgrid:4x3:40mm:0.3:36h11").text, "aprilgrid:4x3:40mm:0.5:36h11");
  EXPECT_EQ(Check("aprilgrid:4x3:40mm:0.4:25h9", "aprilgrid:4x3:40mm:0.4:25h9").relation, "as given");
}

/// The smallest grid that explains the ids.
TEST(CheckBoard, AprilGridsWhoseIdsBeginLate) {
  EXPECT_EQ(Check("aprilgrid:5x4:40mm:0.3:36h11:first=40", "").text, "aprilgrid:5x4:SIDE:0.3:36h11:first=40");
  const std::string printed = "aprilgrid:5x4:40mm:0.3:36h11:first=43";
  EXPECT_EQ(Check(printed, "aprilgrid:5x4:40mm:0.3:36h11").text, printed);
}

TEST(CheckBoard, CirclesAndWhiteCorners) {
  EXPECT_EQ(Check("circles:7x6:40mm", "").text, "circles:7x6:STEP");
  EXPECT_EQ(Check("acircles:4x9:30mm", "").text, "acircles:4x9:STEP");
  EXPECT_EQ(Check("acircles:4x9:30mm:inverted", "acircles:4x9:30mm").relation, "black and white exchanged");
  EXPECT_EQ(Check("chessboard:8x6:40mm:inverted", "").text, "chessboard:8x6:SQUARE:inverted");
}

TEST(CheckBoard, LoneTagsAreListed) {
  const std::vector<Image> photos = Photos("tag:36h11:42:100mm");
  const BoardCheckReport report = CheckBoard(ParseBoard("tag:36h11:0:100mm"), photos, RunContext());
  ASSERT_EQ(report.tags.size(), 2u);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(report.tags[i].id, 42);
    EXPECT_EQ(report.tags[i].image, i);
    const BoardDetection found = DetectBoard(ParseBoard("tag:36h11:42:100mm"), photos[i]);
    ASSERT_EQ(found.detection.num_corners(), 4);
    for (int k = 0; k < 4; ++k) {
      EXPECT_EQ(found.detection.points_px.col(k), report.tags[i].refined_px.col(found.detection.corner_ids[k]));
    }
  }
}

TEST(CheckBoard, NothingFitsAnEmptyWall) {
  const std::vector<Image> wall(2, Image(640, 480, 3, 180));
  for (const char* claimed : {"chessboard:9x6:25mm", "charuco:7x5:40mm:30mm", "aprilgrid:5x3:40mm:0.3"}) {
    EXPECT_FALSE(CheckBoard(ParseBoard(claimed), wall, RunContext()).best.has_value()) << claimed;
  }
}

/// Markers of an oblique board with 9 x 6 squares.
MarkersOfImage MarkersOf9x6() {
  MarkersOfImage markers;
  int id = 0;
  for (int row = 0; row < 6; ++row) {
    for (int col = 0; col < 9; ++col) {
      if ((row + col) % 2 == 0) continue;
      const double x = 50 * col + 5 * row, y = 40 * row + 2 * col, h = 15;
      markers[id++] << x - h, x + h, x + h, x - h, y - h, y - h, y + h, y + h;
    }
  }
  return markers;
}

TEST(GuessCharuco, FromTheIdsAlone) {
  const Board board = ParseBoard("charuco:9x6:40mm:30mm:4x4_50");
  const auto guess = GuessCharuco("4x4_50", {MarkersOf9x6()}, std::nullopt);
  ASSERT_TRUE(guess.has_value());
  EXPECT_EQ(guess->cols, board.cols);
  EXPECT_EQ(guess->rows, board.rows);
  EXPECT_FALSE(guess->legacy);
}

/// One square of clutter that reads as a marker decides nothing, whatever its id.
TEST(GuessCharuco, ClutterAddsNoRows) {
  for (const int id : {30, 45, 60, 102, 997}) {
    MarkersOfImage markers = MarkersOf9x6();
    markers[id] << 600, 640, 640, 600, 300, 300, 340, 340;
    const auto guess = GuessCharuco("4x4_1000", {MarkersOf9x6(), markers}, std::nullopt);
    ASSERT_TRUE(guess.has_value()) << id;
    EXPECT_EQ(guess->cols, 8) << id;
    EXPECT_EQ(guess->rows, 5) << id;
    const auto alone = GuessCharuco("4x4_1000", {markers}, std::nullopt);
    ASSERT_TRUE(alone.has_value()) << id;
    EXPECT_EQ(alone->rows, 5) << id;
  }
}

/// Markers of which no board can be made are reported as such, rather than as a board that nobody has.
TEST(CheckBoard, ClutterAloneIsNoBoard) {
  MarkersOfImage markers;
  for (const int id : {3, 250, 611, 812, 990}) {
    const double x = 100 + id / 2.0, y = 100 + id % 97;
    markers[id] << x, x + 20, x + 20, x, y, y, y + 20, y + 20;
  }
  EXPECT_FALSE(GuessCharuco("4x4_1000", {markers, markers, markers}, std::nullopt).has_value());
}

}  // namespace
}  // namespace mvstudio::calib
