#include "calib/lens/resection.h"

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

View MakeExactView(const geometry::Camera& camera, const geometry::Rigid3& pose, double noise_px, uint64_t seed) {
  const Board board = ParseBoard("chessboard:9x6:30mm");
  View view;
  view.x_in_board = CornersInBoard(board);
  view.px.resize(2, board.num_corners());
  view.weights = Eigen::VectorXd::Ones(board.num_corners());
  Rng rng(seed);
  for (int i = 0; i < board.num_corners(); ++i) {
    view.corner_ids.push_back(i);
    view.px.col(i) = geometry::Project(camera, pose * Eigen::Vector3d(view.x_in_board.col(i))).px +
                     noise_px * Eigen::Vector2d(rng.Normal(), rng.Normal());
  }
  return view;
}

geometry::Rigid3 RandomPose(Rng* rng, double depth) {
  geometry::Rigid3 pose;
  pose.rotation = geometry::RotationExp(Eigen::Vector3d(rng->Uniform(-0.9, 0.9), rng->Uniform(-0.9, 0.9), rng->Uniform(-3, 3)));
  pose.translation = Eigen::Vector3d(rng->Uniform(-0.1, 0.1), rng->Uniform(-0.1, 0.1), depth) -
                     pose.rotation * Eigen::Vector3d(0.12, 0.075, 0);
  return pose;
}

TEST(ResectPlane, ExactForEveryLensModel) {
  Rng rng(5);
  for (geometry::LensModel model : geometry::ModelsSimplestFirst()) {
    const geometry::Camera camera = MakeCamera("c", model);
    for (int k = 0; k < 5; ++k) {
      const geometry::Rigid3 truth = RandomPose(&rng, 0.6);
      const Resection found = ResectPlane(camera, MakeExactView(camera, truth, 0, 1));
      ASSERT_EQ(found.status, Status::kOk);
      EXPECT_LT(geometry::RotationAngle(found.cam_from_board.rotation, truth.rotation), 1e-8);
      EXPECT_LT((found.cam_from_board.translation - truth.translation).norm(), 1e-8);
    }
  }
}

TEST(ResectPlane, NeverWorseThanTheTruthFarAway) {
  Rng rng(7);
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown4);
  for (int k = 0; k < 40; ++k) {
    const geometry::Rigid3 truth = RandomPose(&rng, 6);  // weak perspective: the two orientations of the plane nearly agree
    const View view = MakeExactView(camera, truth, 0.2, 100 + k);
    const Resection found = ResectPlane(camera, view);
    ASSERT_EQ(found.status, Status::kOk);
    const double truth_rms = std::sqrt(ResidualsOf(view, camera, truth)->colwise().squaredNorm().mean());
    EXPECT_LE(found.rms_px, truth_rms * (1 + 1e-9)) << k;
    EXPECT_GE(found.other_rms_px, found.rms_px);
  }
}

TEST(ResectPlane, DegenerateInputHasAStatus) {
  const geometry::Camera camera = MakeCamera("c", geometry::LensModel::kBrown4);
  Rng rng(9);
  const View view = MakeExactView(camera, RandomPose(&rng, 0.8), 0, 1);
  View few = view;
  few.weights.tail(51).setZero();
  EXPECT_EQ(ResectPlane(camera, few).status, Status::kTooFewViews);
  View line = view;
  line.weights.tail(45).setZero();  // one row of nine corners is left
  EXPECT_EQ(ResectPlane(camera, line).status, Status::kDegenerate);
  // Nearly on a line: rounding alone then decides the homography, and the answer must still be a status or a pose that fits.
  for (double bend_m : {1e-15, 1e-12, 1e-9}) {
    View nearly = line;
    nearly.x_in_board(1, 4) += bend_m;
    const Resection found = ResectPlane(camera, nearly);
    EXPECT_TRUE(found.status != Status::kOk || found.rms_px < 1) << bend_m;
  }
  View bad = view;
  bad.px(1, 7) = std::nan("");
  EXPECT_EQ(ResectPlane(camera, bad).status, Status::kNonFiniteInput);
}

}  // namespace
}  // namespace mvstudio::calib
