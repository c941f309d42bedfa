#include "calib/board/space_points.h"

#include "calib/calibrate.h"
#include "calib/lens/held_out_view.h"
#include "calib/lens/intrinsics.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

Eigen::Matrix3Xd Points(int count, double thickness_m, Rng* rng) {
  Eigen::Matrix3Xd points(3, count);
  for (int i = 0; i < count; ++i)
    points.col(i) << rng->Uniform(-0.5, 0.5), rng->Uniform(-0.4, 0.4), thickness_m * rng->Uniform(-1, 1);
  return points;
}

geometry::Rigid3 Pose() {
  geometry::Rigid3 pose;
  pose.rotation = geometry::RotationExp(Eigen::Vector3d(0.3, -0.4, 0.2));
  pose.translation = Eigen::Vector3d(0.05, -0.03, 1.6);
  return pose;
}

View See(const geometry::Camera& camera, const Eigen::Matrix3Xd& points, double noise_px, Rng* rng,
         const geometry::Rigid3& pose = Pose()) {
  View view;
  view.x_in_board = points;
  view.px.resize(2, points.cols());
  view.warp_basis = Eigen::Matrix2Xd::Zero(2, points.cols());
  view.weights = Eigen::VectorXd::Ones(points.cols());
  for (int i = 0; i < static_cast<int>(points.cols()); ++i) {
    view.corner_ids.push_back(i);
    view.px.col(i) = geometry::Project(camera, pose * Eigen::Vector3d(points.col(i))).px +
                     noise_px * Eigen::Vector2d(rng->Normal(), rng->Normal());
  }
  return view;
}

TEST(SpacePoints, OneViewDeterminesTheLens) {
  Rng rng(7);
  const geometry::Camera truth = testing::MakeCamera("c", LensModel::kBrown2);
  const View view = See(truth, Points(60, 0.4, &rng), 0.2, &rng);
  geometry::Camera start = truth;
  start.params.setZero();
  const MonoSolution solved = CalibrateMono(start, {view}, BundleOptions());
  ASSERT_EQ(solved.status, Status::kOk) << solved.message;
  EXPECT_NEAR(solved.state.cameras[0].fx(), truth.fx(), 0.01 * truth.fx());
  EXPECT_LT((solved.state.world_from_board[0].translation - Pose().translation).norm(), 0.02);
  std::vector<double> errors;
  AppendLeftOutPoints(solved.state.cameras[0], view, &errors);
  EXPECT_EQ(errors.size(), 60u);
  EXPECT_LT(Eigen::Map<Eigen::VectorXd>(errors.data(), 60).mean(), 0.5);
}

TEST(SpacePoints, APlaneIsRefusedAsOne) {
  Rng rng(7);
  const geometry::Camera truth = testing::MakeCamera("c", LensModel::kPinhole);
  const View plane = See(truth, Points(60, 0, &rng), 0.2, &rng);
  EXPECT_FALSE(SpansSpace(plane.x_in_board));
  EXPECT_FALSE(SpansSpace(Points(5, 0.4, &rng))) << "five points";
  EXPECT_TRUE(SpansSpace(Points(6, 0.4, &rng)));
  EXPECT_FALSE(FitProjection(plane.x_in_board, plane.px.colwise().homogeneous()).has_value());
  const MonoSolution solved = CalibrateMono(truth, {plane}, BundleOptions());
  EXPECT_EQ(solved.status, Status::kDegenerate);
  EXPECT_NE(solved.message.find("does not separate the focal length from the distance"), std::string::npos);
}

TEST(SpacePoints, ExactRaysGiveTheExactPoseAndFocalLength) {
  Rng rng(9);
  const geometry::Camera truth = testing::MakeCamera("c", LensModel::kPinhole);
  const View view = See(truth, Points(12, 0.3, &rng), 0, &rng);
  Eigen::Matrix3Xd rays(3, view.size());
  for (Eigen::Index i = 0; i < view.size(); ++i) rays.col(i) = Pose() * Eigen::Vector3d(view.x_in_board.col(i));
  const auto pose = PoseInSpace(view.x_in_board, rays);
  ASSERT_TRUE(pose.has_value());
  EXPECT_LT((pose->translation - Pose().translation).norm(), 1e-9);
  EXPECT_LT(pose->rotation.angularDistance(Pose().rotation), 1e-7);
  const auto focal = FocalInSpace(view.x_in_board, view.px, truth.width_px, truth.height_px);
  ASSERT_TRUE(focal.has_value());
  EXPECT_NEAR(*focal, std::sqrt(truth.fx() * truth.fy()), 1e-4);
}

/// Marked points of a room, one image a camera: the world is that of the points.
TEST(SpacePoints, CalibrateFindsTheCamerasInThePointsFrame) {
  Rng rng(11);
  const geometry::Camera truth = testing::MakeCamera("c", LensModel::kBrown1);
  CalibrateInput input;
  input.boards.resize(1);
  input.boards[0].kind = Board::Kind::kPoints;
  input.boards[0].points = Points(60, 0.4, &rng);
  geometry::Rigid3 rotated;
  rotated.rotation = geometry::RotationExp(Eigen::Vector3d(0, 0.7, 0));
  const geometry::Rigid3 poses[] = {Pose(), Pose() * rotated};
  for (int c = 0; c < 2; ++c) {
    const View view = See(truth, input.boards[0].points, 0.2, &rng, poses[c]);
    input.cameras.push_back({"cam" + std::to_string(c), truth.width_px, truth.height_px});
    Detection seen;
    seen.camera_idx = c, seen.corner_ids = view.corner_ids, seen.points_px = view.px;
    input.detections.push_back(seen);
  }
  CalibrateOptions options = testing::PlainOptions();
  options.world.board_frame = 0;
  const CalibrateReport report = Calibrate(input, options, {});
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  for (size_t c = 0; c < 2; ++c) {
    EXPECT_NEAR(report.cameras[c].focal_px, truth.fx(), 0.02 * truth.fx());
    EXPECT_LT((report.rig.cameras[c].CenterInWorld() - geometry::Inverse(poses[c]).translation).norm(), 0.03);
    EXPECT_TRUE(report.cameras[c].points_in_space);
    EXPECT_LT(report.cameras[c].holdout_rms_px, 0.6);
  }
  for (const Notice& reason : report.verdict.reasons) EXPECT_FALSE(reason.fails) << reason.code << " " << reason.text;
}

}  // namespace
}  // namespace mvstudio::calib
