#include "calib/detect_board.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/calib/synthetic.h"

namespace mvstudio::calib {
namespace {

using testing::MakeCamera;
using testing::RenderBoard;

geometry::Rigid3 Pose(const Board& board, const Eigen::Vector3d& rotation, double depth) {
  geometry::Rigid3 pose;
  pose.rotation = geometry::RotationExp(rotation);
  const Eigen::Vector3d center((board.cols - 1) * board.square_m / 2, (board.rows - 1) * board.square_m / 2, 0);
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

TEST(DetectBoard, EmptyImageSaysWhy) {
  const Image blank(640, 480, 3, 200);
  const BoardDetection chess = DetectBoard(ParseBoard("chessboard:9x6:25mm"), blank);
  EXPECT_EQ(chess.status, Status::kTooFewViews);
  EXPECT_EQ(chess.reason, "no chessboard found");
  EXPECT_EQ(DetectBoard(ParseBoard("charuco:7x5:140mm:105mm"), blank).status, Status::kTooFewViews);
}

TEST(DetectBoard, WrongLayoutIsNotTheBoard) {
  const Board printed = ParseBoard("charuco:7x6:120mm:90mm:4x4_250:legacy"),
              claimed = ParseBoard("charuco:7x6:120mm:90mm:4x4_250");
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kPinhole, 620);
  const BoardDetection found = DetectBoard(claimed, RenderBoard(printed, camera, Pose(printed, {0.2, 0.1, 0}, 2.5), 3));
  EXPECT_NE(found.status, Status::kOk);
}

TEST(DetectBoard, RefusesAnUnknownDetector) {
  DetectOptions options;
  options.detector = "magic";
  EXPECT_THROW(DetectBoard(ParseBoard("chessboard:9x6:25mm"), Image(64, 48, 1), options), UsageError);
}

TEST(HasUniqueNumbering, NeedsOddAndEven) {
  EXPECT_TRUE(HasUniqueNumbering(ParseBoard("chessboard:9x6:25mm")));
  EXPECT_FALSE(HasUniqueNumbering(ParseBoard("chessboard:8x6:25mm")));
  EXPECT_TRUE(HasUniqueNumbering(ParseBoard("charuco:7x5:140mm:105mm")));
}

}  // namespace
}  // namespace mvstudio::calib
