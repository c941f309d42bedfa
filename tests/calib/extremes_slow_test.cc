#include <Eigen/Cholesky>
#include <cmath>

#include "calib/calibrate.h"
#include "calib/covariance/uncertainty.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

CalibrateReport Solve(const Scene& scene, LensModel model) {
  CalibrateOptions options;
  options.model = model;
  options.holdout_folds = 0;
  return Calibrate(testing::ToInput(scene), options, RunContext());
}

// --- Outliers -------------------------------------------------------------------------------------------------------

class Outliers : public ::testing::TestWithParam<int> {};

/// A share of the corners of every board lies anywhere in the image.
TEST_P(Outliers, DoNotMoveTheResult) {
  const double share = GetParam() / 100.0;
  SceneOptions options;
  options.num_cameras = 2;
  options.num_frames = 24;
  options.noise_px = 0.1;
  Scene scene = MakeScene(options);
  Rng rng(12);
  std::vector<Detection> clean = scene.detections;
  int spoiled = 0;
  std::vector<std::vector<bool>> is_outlier;
  for (Detection& d : scene.detections) {
    is_outlier.emplace_back(d.num_corners(), false);
    for (int i = 0; i < d.num_corners(); ++i) {
      if (rng.Uniform() >= share) continue;
      d.points_px.col(i) = Eigen::Vector2d(rng.Uniform(0, 639), rng.Uniform(0, 479));
      is_outlier.back()[i] = true;
      ++spoiled;
    }
  }
  const CalibrateReport report = Solve(scene, LensModel::kBrown4);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_NEAR(report.rms_px, 0.1 * std::sqrt(2.0), 0.02);
  int kept_outliers = 0, lost_inliers = 0, corners = 0;
  for (const CornerResidual& corner : report.residuals) {
    for (size_t k = 0; k < scene.detections.size(); ++k) {
      const Detection& d = scene.detections[k];
      if (d.camera_idx != corner.camera_idx || d.frame_idx != corner.frame_idx) continue;
      for (int i = 0; i < d.num_corners(); ++i) {
        if (d.corner_ids[i] != corner.corner_id) continue;
        ++corners;
        const bool far = (d.points_px.col(i) - clean[k].points_px.col(i)).norm() > 2;
        kept_outliers += is_outlier[k][i] && far && !corner.rejected;
        lost_inliers += !is_outlier[k][i] && corner.rejected;
      }
    }
  }
  EXPECT_EQ(kept_outliers, 0) << "of " << spoiled;
  EXPECT_LT(lost_inliers, 0.01 * corners);
  const geometry::Rig truth = testing::TruthRig(scene);
  for (int c = 0; c < 2; ++c) {
    const geometry::RigCamera& found = report.rig.cameras[c];
    ASSERT_TRUE(found.params_covariance.has_value());
    for (Eigen::Index i = 0; i < found.camera.params.size(); ++i) {
      const double sigma = std::sqrt((*found.params_covariance)(i, i));
      EXPECT_LT(std::abs(found.camera.params[i] - truth.cameras[c].camera.params[i]), 4.5 * sigma) << c << ", parameter " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Percent, Outliers, ::testing::Values(1, 30, 49));

// --- A chain --------------------------------------------------------------------------------------------------------

constexpr int kChain = 64, kOwnBoards = 6;

/// Cameras in a row, 0.5 m apart and looking the same way; each has boards of its own and shares one with each neighbour.
Scene MakeChain(double noise_px, uint64_t seed) {
  Scene scene;
  scene.board = ParseBoard("chessboard:9x6:60mm");
  Rng rng(seed);
  std::vector<std::pair<int, int>> sees;  // per frame: the two cameras (or twice the same)
  for (int c = 0; c < kChain; ++c) {
    scene.truth.cameras.push_back(testing::MakeCamera("cam" + std::to_string(c), LensModel::kBrown2, 540 + c % 7));
    const Eigen::Vector3d eye(0.5 * c, 0, 0.05 * (c % 3));
    scene.truth.cam_from_world.push_back(testing::LookAt(eye, eye + Eigen::Vector3d(0, 1, 0)));
  }
  const auto add_board = [&](int a, int b) {
    geometry::Rigid3 cam_from_board;
    cam_from_board.rotation =
        geometry::RotationExp(Eigen::Vector3d(rng.Uniform(-0.6, 0.6), rng.Uniform(-0.6, 0.6), rng.Uniform(-0.5, 0.5)));
    const double beside = a == b ? rng.Uniform(-0.25, 0.25) : 0.25;
    const Eigen::Vector3d center(beside, rng.Uniform(-0.2, 0.2), rng.Uniform(1.0, 1.4));
    cam_from_board.translation = center - cam_from_board.rotation * Eigen::Vector3d(0.24, 0.15, 0);
    scene.truth.frames.push_back(static_cast<int64_t>(scene.truth.frames.size()));
    scene.truth.world_from_board.push_back(geometry::Inverse(scene.truth.cam_from_world[a]) * cam_from_board);
    sees.emplace_back(a, b);
  };
  for (int c = 0; c < kChain; ++c) {
    for (int i = 0; i < kOwnBoards; ++i) add_board(c, c);
    if (c + 1 < kChain) add_board(c, c + 1);
  }
  Rng noise(seed + 1);
  for (size_t f = 0; f < sees.size(); ++f) {
    const auto [a, b] = sees[f];
    for (int c = a; c <= b; ++c) scene.detections.push_back(testing::Observe(scene, c, static_cast<int>(f), noise_px, &noise));
  }
  return scene;
}

geometry::Vector6d PoseError(const geometry::Rigid3& found, const geometry::Rigid3& truth) {
  geometry::Vector6d error;
  error << geometry::RotationLog(found.rotation * truth.rotation.conjugate()), found.translation - truth.translation;
  return error;
}

TEST(ChainOf64Cameras, IsCalibratedAndDriftsAsPredicted) {
  const Scene scene = MakeChain(0.1, 3);
  const CalibrateReport report = Solve(scene, LensModel::kBrown2);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_NEAR(report.sigma_px, 0.1, 0.002);
  const geometry::Rig truth = testing::TruthRig(scene);
  double last_sigma = 0;
  for (int c : {1, 9, 18, 27, 36, 45, 54, 63}) {
    const geometry::RigCamera& found = report.rig.cameras[c];
    ASSERT_TRUE(found.cam_from_world_covariance.has_value());
    const auto& covariance = *found.cam_from_world_covariance;
    const geometry::Vector6d error = PoseError(found.cam_from_world, truth.cameras[c].cam_from_world);
    // chi-square with 6 degrees of freedom: beyond 33 once in 100 000
    EXPECT_LT(error.dot(covariance.ldlt().solve(error)), 33) << "camera " << c << " is " << error.tail<3>().norm() << " m off";
    const double sigma = std::sqrt(covariance.bottomRightCorner<3, 3>().trace());
    EXPECT_GT(sigma, last_sigma) << "uncertainty grows along the chain, camera " << c;
    last_sigma = sigma;
  }
}

TEST(ChainOf64Cameras, NoiseFreeItDoesNotDrift) {
  const Scene scene = MakeChain(0, 4);
  const CalibrateReport report = Solve(scene, LensModel::kBrown2);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  const geometry::Rig truth = testing::TruthRig(scene);
  EXPECT_LT(PoseError(report.rig.cameras[63].cam_from_world, truth.cameras[63].cam_from_world).norm(), 1e-6);
}

TEST(ChainOf64Cameras, ManyDrawsScatterAsPredicted) {
  constexpr int kDraws = 8;
  double sum = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Scene scene = MakeChain(0.1, 100 + draw);
    RigState state = scene.truth;
    std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
    BundleOptions options;
    options.reject_outliers = false;
    ASSERT_EQ(SolveBundle(&views, &state, options).status, Status::kOk);
    const RigCovariance covariance = ComputeCovariance(views, state, options, 0.1);
    ASSERT_EQ(covariance.status, Status::kOk) << covariance.message;
    const geometry::Vector6d error = PoseError(state.cam_from_world[kChain - 1], scene.truth.cam_from_world[kChain - 1]);
    sum += error.dot(covariance.cam_from_world[kChain - 1].ldlt().solve(error));
  }
  // chi-square with 48 degrees of freedom: 3.5 standard deviations
  EXPECT_NEAR(sum / (6 * kDraws), 1, 3.5 * std::sqrt(2.0 / (6 * kDraws)));
}

}  // namespace
}  // namespace mvstudio::calib
