#include "calib/detect/detect_board.h"

#include <algorithm>

#include "calib/board/sets.h"
#include "calib/rig/numbering.h"
#include "core/error.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

geometry::Rigid3 Pose(const Board& board, const Eigen::Vector3d& rotation, double depth) {
  geometry::Rigid3 pose;
  pose.rotation = geometry::RotationExp(rotation);
  const Eigen::Vector3d center = CornersInBoard(board).rowwise().mean();
  pose.translation = Eigen::Vector3d(0.05, -0.03, depth) - pose.rotation * center;
  return pose;
}

/// Largest and RMS distance from the true corners; fails on a wrong number of corners.
void ExpectAccurate(const std::string& text, const Eigen::Vector3d& rotation, double depth) {
  const Board board = ParseBoard(text);
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown5, 620);
  const geometry::Rigid3 pose = Pose(board, rotation, depth);
  const BoardDetection found = DetectBoard(board, RenderBoard(board, camera, pose, 5));
  ASSERT_EQ(found.status, Status::kOk) << text << ": " << found.reason;
  EXPECT_EQ(found.detection.num_corners(), board.num_corners()) << text;
  const Eigen::Matrix3Xd corners = CornersInBoard(board);
  double sum = 0;
  for (int i = 0; i < found.detection.num_corners(); ++i) {
    const Eigen::Vector3d x = corners.col(found.detection.corner_ids[i]);
    const double error = (geometry::Project(camera, pose * x).px - found.detection.points_px.col(i)).norm();
    EXPECT_LT(error, 0.15) << text << " corner " << found.detection.corner_ids[i];
    sum += error * error;
  }
  EXPECT_LT(std::sqrt(sum / found.detection.num_corners()), 0.05) << text;
}

TEST(DetectBoard, CharucoToAFewHundredthsOfAPixel) { ExpectAccurate("charuco:7x5:140mm:105mm", {0.3, -0.4, 2.5}, 2.5); }

TEST(DetectBoard, CharucoFarAway) { ExpectAccurate("charuco:7x5:140mm:105mm", {-0.5, 0.2, -0.6}, 4); }

TEST(DetectBoard, LegacyCharucoWithEvenRows) { ExpectAccurate("charuco:7x6:120mm:90mm:4x4_250:legacy", {0.2, 0.3, 0.4}, 2.5); }

TEST(DetectBoard, CharucoWithEvenRows) { ExpectAccurate("charuco:7x6:120mm:90mm:4x4_250", {0.2, 0.3, 0.4}, 2.5); }

TEST(DetectBoard, ChessboardUprightAndHalfATurnRound) {
  ExpectAccurate("chessboard:9x6:80mm", {0.3, -0.2, 0.1}, 2);
  ExpectAccurate("chessboard:9x6:80mm", {0.3, -0.2, 3.0}, 2);
}

TEST(DetectBoard, InvertedCharuco) { ExpectAccurate("charuco:5x4:140mm:105mm:4x4_1000:inverted", {0.2, 0.3, 0.4}, 2.0); }

TEST(DetectBoard, WideCharucoDoesNotSlipByASquare) {
  ExpectAccurate("charuco:12x9:60mm:45mm", {0.3, -0.3, 0.2}, 1.5);
  ExpectAccurate("charuco:14x10:60mm:45mm:5x5_1000:legacy", {-0.3, 0.3, 0.2}, 2.0);
  ExpectAccurate("charuco:16x11:50mm:38mm:5x5_1000", {0.1, 0.5, 3.0}, 1.5);
}

TEST(DetectBoard, AprilGridNearAndFar) {
  ExpectAccurate("aprilgrid:6x6:88mm:0.3", {0.3, -0.4, 0.3}, 1.5);
  ExpectAccurate("aprilgrid:6x6:88mm:0.3", {0.1, -0.1, 0.3}, 2.5);
  ExpectAccurate("aprilgrid:4x3:100mm:0.3:25h9:first=7", {-0.4, 0.2, 2.0}, 1.6);
}

TEST(DetectBoard, AprilGridWithEitherBorder) {
  const Board printed = ParseBoard("aprilgrid:4x4:88mm:0.3:border=1"), claimed = ParseBoard("aprilgrid:4x4:88mm:0.3");
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown5, 620);
  const BoardDetection found = DetectBoard(claimed, RenderBoard(printed, camera, Pose(printed, {0.2, 0.1, 1}, 1.3), 4));
  ASSERT_EQ(found.status, Status::kOk) << found.reason;
  EXPECT_EQ(found.detection.num_corners(), 64);
}

TEST(DetectBoard, TagsOfEveryFamily) {
  for (const char* family :
       {"36h11", "25h9", "16h5", "36h10", "Circle21h7", "Circle49h12", "Custom48h12", "Standard41h12", "Standard52h13"}) {
    ExpectAccurate("tag:" + std::string(family) + ":7:300mm", {0.3, -0.4, 0.3}, 3);
  }
  ExpectAccurate("tag:36h11:7:300mm:border=2", {0.3, -0.4, 2.3}, 3);
}

TEST(DetectBoard, SingleArucoMarkers) {
  for (const char* dictionary : {"4x4_50", "5x5_100", "6x6_250", "7x7_1000", "aruco_original"})
    ExpectAccurate("tag:" + std::string(dictionary) + ":7:300mm", {0.3, -0.4, 2.3}, 3);
  EXPECT_EQ(ToString(ParseBoard("markers:DICT_4X4_50:7:60mm")), "tag:4x4_50:7:60mm");
  EXPECT_EQ(ToString(ParseBoard("tag:apriltag_36h11:7:60mm")), "tag:36h11:7:60mm");
  EXPECT_THROW(ParseBoard("tag:4x4_50:50:60mm"), UsageError);
  EXPECT_THROW(ParseBoard("tag:4x4_50:7:60mm:border=2"), UsageError);
  EXPECT_THROW(ParseBoard("aprilgrid:6x6:88mm:0.3:4x4_50"), UsageError);
  const auto shared = [](const char* a, const char* b) { return SharedMarks(ParseBoard(a), ParseBoard(b)); };
  EXPECT_EQ(shared("tag:4x4_50:7:60mm", "charuco:6x5:30mm:20mm:4x4_1000"), "markers 7 to 7 of 4x4");
  EXPECT_EQ(shared("tag:4x4_50:15:60mm", "charuco:6x5:30mm:20mm:4x4_1000"), "");
  EXPECT_EQ(shared("tag:36h11:3:60mm", "charuco:6x5:30mm:20mm:apriltag_36h11"), "markers 3 to 3 of 36h11");
}

TEST(SingleBoards, ASetIsItsTags) {
  const Board set = ParseBoard("tags:4x4_50:3-5:60mm");
  EXPECT_EQ(ToString(set), "tag:4x4_50:3-5:60mm");
  const std::vector<Board> singles = SingleBoards({ParseBoard("chessboard:9x6:25mm"), set});
  ASSERT_EQ(singles.size(), 4u);
  EXPECT_EQ(ToString(singles[1]), "tag:4x4_50:3:60mm");
  EXPECT_EQ(ToString(singles[3]), "tag:4x4_50:5:60mm");
  for (const char* wrong : {"tag:4x4_50:5-3:60mm", "tag:4x4_50:45-50:60mm", "tag:4x4_50:3-:60mm", "tag:4x4_50:-3:60mm"})
    EXPECT_THROW(ParseBoard(wrong), UsageError) << wrong;
  EXPECT_THROW(RequireSearchable(set), UsageError);
  EXPECT_THROW(DrawBoard(set, 10, 1), UsageError);
}

TEST(DetectBoard, TagsOfFifteenPixels) { ExpectAccurate("tag:36h11:7:300mm", {0.1, 0.2, 0.3}, 12); }

TEST(DetectBoard, AprilGridsOfTheNewerFamilies) {
  ExpectAccurate("aprilgrid:4x3:100mm:0.8:Standard41h12", {0.3, -0.4, 0.3}, 1.4);
}

// As a search that slips leaves them: two columns in place, and up to three beside them a square off. Nothing but
// themselves says where the third column lies.
TEST(LocateBoard, CornersThatNothingHoldsDoNotBendTheBoard) {
  const Board board = ParseBoard("chessboard:4x7:60mm");
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown5, 620);
  const geometry::Rigid3 pose = Pose(board, {0.3, -0.2, 0.4}, 1.2);
  const Image image = RenderBoard(board, camera, pose, 5);
  const Eigen::Matrix3Xd corners = CornersInBoard(board);
  const auto px = [&](double x, double y) {
    return geometry::Project(camera, pose * Eigen::Vector3d(corners.col(0) + board.square_m * Eigen::Vector3d(x, y, 0))).px;
  };
  const auto guess = [&](int x, int y, double at_x, double at_y) {
    return CornerGuess{x + 4 * y, px(at_x, at_y), px(at_x + 0.5, at_y) - px(at_x - 0.5, at_y),
                       px(at_x, at_y + 0.5) - px(at_x, at_y - 0.5)};
  };
  for (const int num_wrong : {1, 2, 3}) {
    std::vector<CornerGuess> guesses;
    for (int y = 0; y < 7; ++y) guesses.push_back(guess(2, y, 2, y)), guesses.push_back(guess(3, y, 3, y));
    for (int y = 0; y < num_wrong; ++y) guesses.push_back(guess(1, y, 0, y + 1));  // a corner of the same colours
    const BoardDetection found = LocateBoard(board, image, guesses);
    ASSERT_EQ(found.status, Status::kOk) << found.reason;
    EXPECT_GE(found.detection.num_corners(), 21) << "the others are found once those are gone";
    for (int i = 0; i < found.detection.num_corners(); ++i) {
      const int id = found.detection.corner_ids[i];
      EXPECT_LT((px(id % 4, id / 4) - found.detection.points_px.col(i)).norm(), 0.15) << num_wrong << " wrong, corner " << id;
    }
  }
}

TEST(DetectBoard, PartOfAnAprilGrid) {
  const Board board = ParseBoard("aprilgrid:6x6:88mm:0.3");
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kPinhole, 620);
  const geometry::Rigid3 pose = Pose(board, {0.2, 0.1, 0.4}, 1.5);
  Image image = RenderBoard(board, camera, pose, 3);
  for (int v = 0; v < image.height; ++v) std::fill(image.Pixel(0, v), image.Pixel(300, v), 90);
  const BoardDetection found = DetectBoard(board, image);
  ASSERT_EQ(found.status, Status::kOk) << found.reason;
  const Eigen::Matrix3Xd corners = CornersInBoard(board);
  for (int i = 0; i < found.detection.num_corners(); ++i) {
    const Eigen::Vector2d truth =
        geometry::Project(camera, pose * Eigen::Vector3d(corners.col(found.detection.corner_ids[i]))).px;
    EXPECT_LT((truth - found.detection.points_px.col(i)).norm(), 0.15);
    EXPECT_GT(truth.x(), 299);
  }
  EXPECT_GT(found.detection.num_corners(), 40);
}

Image Mirrored(const Image& image) {
  Image mirrored = image;
  for (int v = 0; v < image.height; ++v)
    std::reverse_copy(image.Pixel(0, v), image.Pixel(0, v) + image.width, mirrored.Pixel(0, v));
  return mirrored;
}

TEST(DetectBoard, MirroredImagesAreNoticed) {
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kPinhole, 620);
  for (const char* text : {"charuco:7x5:140mm:105mm", "charuco:7x6:120mm:90mm:4x4_250:legacy", "aprilgrid:5x4:150mm:0.3",
                           "tag:36h11:7:500mm", "charuco:7x5:140mm:105mm:inverted"}) {
    const Board board = ParseBoard(text);
    const BoardDetection found = DetectBoard(board, Mirrored(RenderBoard(board, camera, Pose(board, {0.2, 0.1, 0.4}, 2.5), 3)));
    EXPECT_EQ(found.status, Status::kDegenerate) << text;
    EXPECT_NE(found.reason.find("mirror"), std::string::npos) << text << ": " << found.reason;
  }
}

TEST(DetectBoard, FindsTheLayoutOfACharucoBoard) {
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kPinhole, 620);
  for (const char* text :
       {"charuco:7x6:120mm:90mm:4x4_250", "charuco:7x6:120mm:90mm:4x4_250:legacy", "charuco:6x6:120mm:90mm:4x4_250:legacy",
        "charuco:7x6:120mm:90mm:4x4_250:inverted", "charuco:7x6:120mm:90mm:4x4_250:legacy:inverted"}) {
    const Board printed = ParseBoard(text);
    Board claimed = printed;
    claimed.legacy = claimed.inverted = false;
    const geometry::Rigid3 pose = Pose(printed, {0.2, 0.1, 0.3}, 2.5);
    const BoardDetection found = DetectBoard(claimed, RenderBoard(printed, camera, pose, 3));
    ASSERT_EQ(found.status, Status::kOk) << text << ": " << found.reason;
    EXPECT_EQ(found.legacy, printed.legacy) << text;
    EXPECT_EQ(found.inverted, printed.inverted) << text;
    EXPECT_EQ(found.detection.num_corners(), printed.num_corners()) << text;
    const Eigen::Vector2d truth =
        geometry::Project(camera, pose * Eigen::Vector3d(CornersInBoard(printed).col(found.detection.corner_ids[3]))).px;
    EXPECT_LT((truth - found.detection.points_px.col(3)).norm(), 0.15) << text;
  }
}

TEST(DetectBoards, SeveralBoardsInOneImage) {
  const Board tag = ParseBoard("tag:36h11:7:300mm"), other = ParseBoard("tag:36h11:8:300mm"),
              charuco = ParseBoard("charuco:7x5:60mm:45mm");
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kPinhole, 620);
  const geometry::Rigid3 pose = Pose(tag, {0.2, 0.1, 0.4}, 2.5);
  const auto found = DetectBoards({charuco, other, tag}, RenderBoard(tag, camera, pose, 3));
  ASSERT_EQ(found.size(), 3u);
  EXPECT_EQ(found[0][0].status, Status::kTooFewViews);
  EXPECT_EQ(found[1][0].status, Status::kTooFewViews);
  EXPECT_EQ(found[2][0].status, Status::kOk);
}

TEST(DetectBoard, EmptyImageSaysWhy) {
  const Image blank(640, 480, 3, 200);
  const BoardDetection chess = DetectBoard(ParseBoard("chessboard:9x6:25mm"), blank);
  EXPECT_EQ(chess.status, Status::kTooFewViews);
  EXPECT_EQ(chess.reason, "no chessboard found");
  EXPECT_EQ(DetectBoard(ParseBoard("charuco:7x5:140mm:105mm"), blank).status, Status::kTooFewViews);
}

TEST(DetectBoard, WrongLayoutIsNotTheBoard) {
  const Board printed = ParseBoard("charuco:7x6:120mm:90mm:4x4_250"),
              claimed = ParseBoard("charuco:7x6:120mm:90mm:4x4_250:legacy");
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kPinhole, 620);
  const BoardDetection found = DetectBoard(claimed, RenderBoard(printed, camera, Pose(printed, {0.2, 0.1, 0}, 2.5), 3));
  EXPECT_NE(found.status, Status::kOk);
}

TEST(DetectBoard, WrongNumberOfColumnsIsNotTheBoard) {
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kPinhole, 620);
  const auto detect = [&](const char* printed_text, const char* claimed) {
    const Board printed = ParseBoard(printed_text);
    return DetectBoard(ParseBoard(claimed), RenderBoard(printed, camera, Pose(printed, {0.2, 0.1, 0}, 2.5), 3)).status;
  };
  EXPECT_NE(detect("charuco:12x9:90mm:65mm", "charuco:11x9:90mm:65mm"), Status::kOk);
  EXPECT_NE(detect("aprilgrid:6x5:150mm:0.3", "aprilgrid:5x6:150mm:0.3"), Status::kOk);
}

TEST(DetectBoard, CornerFileBoardsAreNotSearched) {
  EXPECT_THROW(DetectBoard(ParseBoard("grid:10x10:77mm"), Image(64, 48, 1)), UsageError);
}

TEST(DetectBoard, RefusesAnUnknownDetector) {
  Detector detector = Detector::kFast;
  EXPECT_THROW(FromString("magic", &detector), UsageError);
  FromString("exact", &detector);
  EXPECT_EQ(detector, Detector::kExact);
}

TEST(NumLikeTurns, OfChessboardsAndCircles) {
  const std::vector<std::pair<const char*, int>> boards = {
      {"chessboard:9x6:25mm", 1}, {"chessboard:8x6:25mm", 2},    {"chessboard:7x5:25mm", 2},     {"chessboard:9x9:25mm", 2},
      {"chessboard:8x8:25mm", 4}, {"chessboard:8x8:25x24mm", 2}, {"charuco:7x5:140mm:105mm", 1}, {"circles:7x6:30mm", 2},
      {"circles:6x6:30mm", 4},    {"acircles:4x11:20mm", 1},     {"acircles:4x10:20mm", 2},      {"grid:6x6:30mm", 4}};
  for (const auto& [text, turns] : boards) EXPECT_EQ(NumLikeTurns(ParseBoard(text)), turns) << text;
}

/// A chessboard in one view; the numbering may be any that the board looks like.
void ExpectFoundInSomeTurn(const Board& board, const Image& image, const geometry::Camera& camera, const geometry::Rigid3& pose,
                           const std::string& what) {
  const BoardDetection found = DetectBoard(board, image);
  ASSERT_EQ(found.status, Status::kOk) << what << ": " << found.reason;
  ASSERT_EQ(found.detection.num_corners(), board.num_corners()) << what;
  const Eigen::Matrix3Xd corners = CornersInBoard(board);
  double least = 1e9;
  for (int quarters = 0; quarters < 4; quarters += 4 / NumLikeTurns(board)) {
    double sum = 0;
    for (int i = 0; i < board.num_corners(); ++i) {
      const int id = RotatedCorner(found.detection.corner_ids[i], board.num_corners(), quarters);
      sum += (geometry::Project(camera, pose * corners.col(id)).px - found.detection.points_px.col(i)).squaredNorm();
    }
    least = std::min(least, std::sqrt(sum / board.num_corners()));
    if (NumLikeTurns(board) == 1) break;
  }
  EXPECT_LT(least, 0.12) << what;
}

TEST(DetectBoard, ChessboardsInEveryTurnAndBothColours) {
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown5, 620);
  for (const char* size : {"5x5", "6x6", "7x5", "8x6"}) {
    for (const bool inverted : {false, true}) {
      const Board told = ParseBoard("chessboard:" + std::string(size) + ":60mm");
      Board printed = told;
      printed.inverted = inverted;
      for (const double turn : inverted ? std::vector<double>{1.6} : std::vector<double>{0.05, 1.6, 4.75}) {
        const geometry::Rigid3 pose = Pose(printed, {0.25, -0.2, turn}, 1.3);
        const Image image = RenderBoard(printed, camera, pose, 3);
        const std::string what = ToString(printed) + " turned by " + std::to_string(turn);
        ExpectFoundInSomeTurn(printed, image, camera, pose, what);
        if (!inverted) continue;
        const BoardDetection found = DetectBoard(told, image);
        EXPECT_EQ(found.status, Status::kOk) << what << " as " << ToString(told) << ": " << found.reason;
        EXPECT_EQ(found.detection.num_corners(), told.num_corners()) << what;
      }
    }
  }
}

TEST(DetectBoard, ColoursOfTheOtherKindAreNamed) {
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown5, 620);
  const Board black = ParseBoard("chessboard:8x6:60mm"), white = ParseBoard("chessboard:8x6:60mm:inverted");
  const BoardDetection found = DetectBoard(white, RenderBoard(black, camera, Pose(black, {0.2, 0.1, 0.1}, 1.3), 4));
  EXPECT_EQ(found.status, Status::kDegenerate);
  EXPECT_EQ(found.reason, "black and white are exchanged");
}

TEST(DetectBoard, CellsThatAreNotSquare) {
  ExpectAccurate("chessboard:9x6:70x82mm", {0.3, -0.2, 0.1}, 2);
  ExpectAccurate("chessboard:5x5:90x75mm", {0.3, -0.2, 0.05}, 2);
  EXPECT_THROW(DetectBoard(ParseBoard("chessboard:8x8:20x25mm"), Image(64, 64, 1)), UsageError);
}

}  // namespace
}  // namespace mvstudio::calib
