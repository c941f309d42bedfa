#include <Eigen/Geometry>
#include <algorithm>

#include "calib/calibrate.h"
#include "calib/detect/circle_refine.h"
#include "calib/detect/detect_board.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

geometry::Rigid3 PoseAt(const Board& board, const Eigen::Vector3d& rotation, double depth, double aside = 0) {
  geometry::Rigid3 pose;
  pose.rotation = geometry::RotationExp(rotation);
  pose.translation = Eigen::Vector3d(aside, -0.02, depth) - pose.rotation * CornersInBoard(board).rowwise().mean();
  return pose;
}

/// Distances of the circles found from the truth, rms; a whole board is expected.
double ErrorOf(const Board& board, const BoardDetection& found, const geometry::Camera& camera, const geometry::Rigid3& pose) {
  EXPECT_EQ(found.status, Status::kOk) << ToString(board) << ": " << found.reason;
  EXPECT_EQ(found.detection.num_corners(), board.num_corners()) << ToString(board);
  const Eigen::Matrix3Xd centres = CornersInBoard(board);
  double sum = 0;
  for (int i = 0; i < found.detection.num_corners(); ++i)
    sum += (geometry::Project(camera, pose * centres.col(found.detection.corner_ids[static_cast<size_t>(i)])).px -
            found.detection.points_px.col(i))
               .squaredNorm();
  return std::sqrt(sum / std::max(1, found.detection.num_corners()));
}

TEST(Circles, CentresToAFewHundredthsOfAPixel) {
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown5, 620);
  for (const char* text : {"circles:7x6:40mm", "circles:7x6:40x50mm", "acircles:4x11:30mm", "acircles:4x11:30mm:inverted"}) {
    const Board board = ParseBoard(text);
    const geometry::Rigid3 pose = PoseAt(board, {0.5, -0.45, 0.1}, 0.75);
    const BoardDetection found = DetectBoard(board, RenderBoard(board, camera, pose, 5));
    EXPECT_LT(ErrorOf(board, found, camera, pose), 0.03) << text;
  }
}

TEST(Circles, AsymmetricGridsInEveryTurn) {
  const Board board = ParseBoard("acircles:4x11:30mm");
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown5, 620);
  for (const double turn : {1.5, 3.0, 4.6}) {
    const geometry::Rigid3 pose = PoseAt(board, {0.2, -0.3, turn}, 0.9);
    EXPECT_LT(ErrorOf(board, DetectBoard(board, RenderBoard(board, camera, pose, 4)), camera, pose), 0.03) << turn;
  }
}

TEST(Circles, ColoursAndSizesOfOthersAreNamed) {
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown5, 620);
  const Board white = ParseBoard("circles:7x6:40mm:inverted");
  const Image image = RenderBoard(white, camera, PoseAt(white, {0.2, -0.3, 0.1}, 0.75), 4);
  const BoardDetection found = DetectBoard(ParseBoard("circles:7x6:40mm"), image);
  EXPECT_EQ(found.status, Status::kOk) << found.reason;
  EXPECT_TRUE(found.inverted);
  const Board black = ParseBoard("circles:7x6:40mm");
  const Image plain = RenderBoard(black, camera, PoseAt(black, {0.2, -0.3, 0.1}, 0.75), 4);
  for (const char* wrong : {"circles:6x5:40mm", "circles:8x6:40mm", "acircles:4x11:30mm"})
    EXPECT_EQ(DetectBoard(ParseBoard(wrong), plain).status, Status::kDegenerate) << wrong;
  EXPECT_EQ(DetectBoard(white, Image(640, 480, 1, 180)).reason, "no grid of circles found");
}

/// Large circles under strong tilt: the centres of the ellipses lie off the images of the centres, and the focal length with
/// them.
TEST(Circles, TheEllipsesBiasIsTakenOff) {
  const Board board = ParseBoard("circles:6x5:60mm:48mm");
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kPinhole, 560);
  CalibrateInput input;
  input.boards = {board};
  input.cameras = {{"c", 640, 480}};
  double worst_bias = 0;
  int frame = 0;
  for (const Eigen::Vector3d& rotation :
       {Eigen::Vector3d(0.8, 0, 0), Eigen::Vector3d(0, 0.8, 0.1), Eigen::Vector3d(-0.7, 0.3, 0),
        Eigen::Vector3d(0.3, -0.8, 0.2), Eigen::Vector3d(0.1, 0.1, 0.1)}) {
    const geometry::Rigid3 pose = PoseAt(board, rotation, 0.56, 0.03 * (frame - 2));
    BoardDetection found = DetectBoard(board, RenderBoard(board, camera, pose, 4));
    EXPECT_LT(ErrorOf(board, found, camera, pose), 0.03) << frame;
    const Eigen::Matrix3Xd centres = CornersInBoard(board);
    for (const auto& centre : centres.colwise()) {  // the conic of the circle's image
      Eigen::Matrix3d from_plane;
      const Eigen::Matrix3d r = pose.rotation.toRotationMatrix();
      from_plane << r.col(0), r.col(1), pose * Eigen::Vector3d(centre);
      Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
      k(0, 0) = camera.params[0], k(1, 1) = camera.params[1], k(0, 2) = camera.params[2], k(1, 2) = camera.params[3];
      const Eigen::Matrix3d h = k * from_plane;
      const Eigen::Matrix3d dual =
          h * Eigen::Vector3d(std::pow(board.circle_m / 2, 2), std::pow(board.circle_m / 2, 2), -1).asDiagonal() *
          h.transpose();
      const Eigen::Vector2d of_ellipse(dual(0, 2) / dual(2, 2), dual(1, 2) / dual(2, 2));
      worst_bias = std::max(worst_bias, (of_ellipse - h.col(2).hnormalized()).norm());
    }
    found.detection.frame_idx = frame++;
    input.detections.push_back(found.detection);
  }
  EXPECT_GT(worst_bias, 0.5) << "a case that tells";
  CalibrateOptions options = testing::PlainOptions();
  options.model = geometry::LensModel::kPinhole;
  options.motions = false;
  const CalibrateReport report = Calibrate(input, options, RunContext());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_NEAR(report.rig.cameras[0].camera.params[0] / camera.params[0], 1, 0.002);
}

}  // namespace
}  // namespace mvstudio::calib
