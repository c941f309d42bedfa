#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

#include "calib/board/propose.h"
#include "calib/detect/detect_board.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// As a camera sees it: blurred by 0.7 px, with noise of 2 grey values.
Image Filmed(const Image& sharp, Rng* random) {
  Image image = sharp;
  cv::Mat pixels(image.height, image.width, CV_8UC1, image.pixels.data());
  cv::GaussianBlur(pixels, pixels, {5, 5}, 0.7);
  for (int v = 0; v < pixels.rows; ++v) {
    for (int u = 0; u < pixels.cols; ++u)
      pixels.at<uint8_t>(v, u) = cv::saturate_cast<uint8_t>(pixels.at<uint8_t>(v, u) + 2 * random->Normal());
  }
  return image;
}

/// The share of tilted boards that are found with half of their corners or more, where a side has `side_px` upright.
double FoundAt(const Board& board, double side_px, uint64_t seed) {
  constexpr int kPoses = 8;
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown5, 620);
  Rng random(seed);
  int found = 0;
  for (int i = 0; i < kPoses; ++i) {
    const double turn = 2 * M_PI * i / kPoses, tilt = 40 * M_PI / 180;
    geometry::Rigid3 pose;
    pose.rotation =
        geometry::RotationExp({tilt * std::cos(turn), tilt * std::sin(turn), 0}) * geometry::RotationExp({0, 0, 0.3});
    pose.translation = Eigen::Vector3d(0, 0, 620 * board.square_m / side_px) -
                       pose.rotation * Eigen::Vector3d(CornersInBoard(board).rowwise().mean());
    const BoardDetection detection = DetectBoard(board, Filmed(RenderBoard(board, camera, pose, 3), &random));
    found += detection.status == Status::kOk && 2 * detection.detection.num_corners() >= board.num_corners();
  }
  return static_cast<double>(found) / kPoses;
}

TEST(ProposeBoards, EachFitsItsPaperAndNoneLargerDoes) {
  for (const Paper paper : {Paper::kA4, Paper::kA3, Paper::kA1, Paper::kLetter}) {
    ProposeOptions options;
    options.paper = paper;
    const auto proposals = ProposeBoards(options);
    ASSERT_GE(proposals.size(), 6u);
    for (const BoardProposal& proposal : proposals) {
      EXPECT_TRUE(FitsPaper(proposal.board, {paper})) << ToString(proposal.board);
      Board larger = proposal.board;
      larger.square_m += 1e-3;
      EXPECT_FALSE(FitsPaper(larger, {paper})) << ToString(larger);
      EXPECT_EQ(ToString(ParseBoard(ToString(proposal.board))), ToString(proposal.board));
    }
  }
}

TEST(ProposeBoards, DistancesFollowTheCamera) {
  ProposeOptions options;
  const BoardProposal wide = ProposeBoards(options).front();
  options.image_width_px *= 2;
  const BoardProposal fine = ProposeBoards(options).front();
  EXPECT_NEAR(fine.far_m, 2 * wide.far_m, 1e-12);
  EXPECT_NEAR(fine.near_m, wide.near_m, 1e-12);
  EXPECT_NEAR(wide.near_m, wide.width_m / (2 * std::tan(options.fov_deg * M_PI / 360)), 1e-12);
  EXPECT_GT(wide.far_m, wide.near_m);
}

TEST(ProposeBoards, AreFoundAtTheFarthestDistance) {
  for (const char* text :
       {"charuco:7x5:40mm:30mm", "charuco:12x9:20mm:15mm", "chessboard:9x6:25mm", "aprilgrid:6x4:30mm:0.3"}) {
    const Board board = ParseBoard(text);
    EXPECT_EQ(FoundAt(board, LeastSquarePx(board.kind), 11), 1) << text;
    EXPECT_LT(FoundAt(board, 0.4 * LeastSquarePx(board.kind), 11), 1) << text << ": the limit is too careful";
  }
}

TEST(ProposeBoards, OfATooLargeBoardTheLargestThatFits) {
  const std::string message = MessageOf<UsageError>([] { LayOutBoard(ParseBoard("charuco:8x6:60mm:45mm"), {}); });
  EXPECT_NE(message.find("the largest of its kind there is charuco:8x6:"), std::string::npos) << message;
  EXPECT_FALSE(LargestOn(ParseBoard("chessboard:200x199:25mm"), Paper::kA4).has_value());
}

/// Few pixels and a wide view: the far limit is nearer than the near one. From the stated width on it is not.
TEST(ProposeBoards, SaysWhichSuitNoDistance) {
  ProposeOptions options;
  options.paper = Paper::kA3, options.fov_deg = 90, options.image_width_px = 320;
  int num_unsuited = 0;
  for (const BoardProposal& proposal : ProposeBoards(options)) {
    EXPECT_EQ(proposal.Suits(), proposal.near_m <= proposal.far_m);
    EXPECT_EQ(LeastImageWidthPx(proposal, 320) <= 320, proposal.Suits());
    num_unsuited += !proposal.Suits();
  }
  EXPECT_EQ(num_unsuited, 2) << "the AprilGrids";
  const BoardProposal worst = ProposeBoards(options).back();
  for (const int less : {0, 1}) {
    options.image_width_px = LeastImageWidthPx(worst, 320) - less;
    EXPECT_EQ(ProposeBoards(options).back().Suits(), less == 0);
  }
}

TEST(ProposeBoards, RefusesCamerasThatCannotBe) {
  for (const double fov : {0.0, -5.0, 180.0, std::nan("")}) {
    ProposeOptions options;
    options.fov_deg = fov;
    EXPECT_THROW(ProposeBoards(options), UsageError) << fov;
  }
  ProposeOptions none;
  none.paper = Paper::kNone;
  EXPECT_THROW(ProposeBoards(none), UsageError);
}

// What LeastSquarePx is chosen by: MVSTUDIO_MEASURE=1 prints the share found for each size.
TEST(ProposeBoards, ShareFoundFallsWithSize) {
  const bool all = std::getenv("MVSTUDIO_MEASURE") != nullptr;
  for (const char* text :
       {"charuco:7x5:40mm:30mm", "charuco:12x9:20mm:15mm", "chessboard:9x6:25mm", "aprilgrid:6x4:30mm:0.3"}) {
    const Board board = ParseBoard(text);
    const double large = FoundAt(board, 48, 5), small = FoundAt(board, 3, 5);
    EXPECT_EQ(large, 1) << text;
    EXPECT_EQ(small, 0) << text;
    for (double side = 6; all && side <= 32; side += 2) std::printf("%s %g px: %.3f\n", text, side, FoundAt(board, side, 5));
  }
}

}  // namespace
}  // namespace mvstudio::calib
